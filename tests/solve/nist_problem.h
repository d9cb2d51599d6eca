// The regression problems of NIST StRD (tests/solve/nist/README.md): a reader, and the models as one residual for each
// each number of parameters, written as a user would, over any scalar.
#pragma once
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "oriel/manifold/vector.h"
#include "oriel/residual/residual.h"

namespace oriel::nist {

struct Observation {
  double y = 0.0, x = 0.0, x2 = 0.0;
};

struct NistProblem {
  std::string name;
  std::vector<double> start[2], certified;
  double residual_sum_of_squares = 0.0;
  std::vector<Observation> observations;
};

// Empty where the file is not as its README says.
NistProblem read_problem(const std::string& path);

enum class Model {
  misra1a,  // BoxBOD too
  misra1b,
  misra1c,
  misra1d,
  danwood,
  chwirut,
  rat42,
  mgh10,
  bennett5,
  eckerle4,
  nelson,
  rat43,
  mgh09,
  roszman1,
  mgh17,
  kirby2,
  lanczos,
  cubics,  // Hahn1, Thurber
  gauss,
  enso,
};

template <class S>
S bell(const S& height, const S& center, const S& width, double x) {
  using std::exp;
  const S u = (S(x) - center) / width;
  return height * exp(-(u * u));
}
template <class S>
S wave(const S& cosine, const S& sine, const S& period, double x) {
  using std::cos, std::sin;
  const S u = S(2.0 * std::numbers::pi * x) / period;
  return cosine * cos(u) + sine * sin(u);
}

// The models as NIST states them, in the comments of the files. A power is written as exp(p log b).
template <class S>
S predict(Model model, const Vec<S, 2>& b, const Observation& o) {
  using std::exp, std::log, std::sqrt;
  const S one(1.0), bx = b[1] * S(o.x);
  switch (model) {
    case Model::misra1b: {
      const S u = one + bx * S(0.5);
      return b[0] * (one - one / (u * u));
    }
    case Model::misra1c:
      return b[0] * (one - one / sqrt(one + S(2.0) * bx));
    case Model::misra1d:
      return b[0] * bx / (one + bx);
    case Model::danwood:
      return b[0] * exp(b[1] * S(std::log(o.x)));
    default:
      return b[0] * (one - exp(-bx));
  }
}
template <class S>
S predict(Model model, const Vec<S, 3>& b, const Observation& o) {
  using std::exp, std::log;
  const S x(o.x), one(1.0);
  switch (model) {
    case Model::rat42:
      return b[0] / (one + exp(b[1] - b[2] * x));
    case Model::mgh10:
      return b[0] * exp(b[1] / (x + b[2]));
    case Model::bennett5:
      return b[0] * exp(-log(b[1] + x) / b[2]);
    case Model::eckerle4: {
      const S u = (x - b[2]) / b[1];
      return b[0] / b[1] * exp(S(-0.5) * u * u);
    }
    case Model::nelson:
      return b[0] - b[1] * x * exp(-b[2] * S(o.x2));
    default:
      return exp(-b[0] * x) / (b[1] + b[2] * x);
  }
}
template <class S>
S predict(Model model, const Vec<S, 4>& b, const Observation& o) {
  using std::atan2, std::exp, std::log;
  const S x(o.x), one(1.0);
  switch (model) {
    case Model::rat43:
      return b[0] * exp(-log(one + exp(b[1] - b[2] * x)) / b[3]);
    case Model::mgh09:
      return b[0] * (x * x + x * b[1]) / (x * x + x * b[2] + b[3]);
    default:
      return b[0] - b[1] * x - atan2(b[2] / (x - b[3]), one) * S(1.0 / std::numbers::pi);
  }
}
template <class S>
S predict(Model model, const Vec<S, 5>& b, const Observation& o) {
  using std::exp;
  const S x(o.x);
  if (model == Model::mgh17) return b[0] + b[1] * exp(-x * b[3]) + b[2] * exp(-x * b[4]);
  return (b[0] + x * (b[1] + x * b[2])) / (S(1.0) + x * (b[3] + x * b[4]));
}
template <class S>
S predict(Model, const Vec<S, 6>& b, const Observation& o) {
  using std::exp;
  const S x(o.x);
  return b[0] * exp(-b[1] * x) + b[2] * exp(-b[3] * x) + b[4] * exp(-b[5] * x);
}
template <class S>
S predict(Model, const Vec<S, 7>& b, const Observation& o) {
  const S x(o.x);
  return (b[0] + x * (b[1] + x * (b[2] + x * b[3]))) / (S(1.0) + x * (b[4] + x * (b[5] + x * b[6])));
}
template <class S>
S predict(Model, const Vec<S, 8>& b, const Observation& o) {
  using std::exp;
  return b[0] * exp(-b[1] * S(o.x)) + bell(b[2], b[3], b[4], o.x) + bell(b[5], b[6], b[7], o.x);
}
template <class S>
S predict(Model, const Vec<S, 9>& b, const Observation& o) {
  return b[0] + wave(b[1], b[2], S(12.0), o.x) + wave(b[4], b[5], b[3], o.x) + wave(b[7], b[8], b[6], o.x);
}

template <int N>
struct Fit {
  static constexpr char kText[] = {'n', 'i', 's', 't', '0' + N, '/', '1', '\0'};
  static constexpr std::string_view kName = kText;
  using Variables = Types<VectorNd<N>>;
  Model model = Model::misra1a;
  Observation seen;  // of Nelson: log(y)
  template <class S>
  S operator()(const VectorN<S, N>& b) const {
    return S(seen.y) - predict(model, b.v, seen);
  }
};

}  // namespace oriel::nist
