// NIST's StRD of nonlinear regression: 27 problems, each from two starts, the first far off. Scored as is usual: digits
// = -log10 of the largest relative error of a parameter against the certified 11 digits, at most 11.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "oriel/solve/native_engine.h"
#include "solve/nist_problem.h"

namespace oriel::nist {

NistProblem read_problem(const std::string& path) {
  NistProblem p;
  std::ifstream file(path);
  int parameters = 0, observations = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream in(line);
    if (std::string word; std::isalpha(static_cast<unsigned char>(line[0])) != 0) {
      in >> word;
      if (word == "parameters") in >> parameters;
      if (word == "residual_sum_of_squares") in >> p.residual_sum_of_squares;
      if (word == "observations") in >> observations;
    } else if (static_cast<int>(p.certified.size()) < parameters) {
      double first = NAN, second = NAN, certified = NAN;
      in >> first >> second >> certified;
      p.start[0].push_back(first), p.start[1].push_back(second), p.certified.push_back(certified);
    } else {
      Observation o;
      in >> o.y >> o.x;
      in >> o.x2;
      p.observations.push_back(o);
    }
  }
  return static_cast<int>(p.observations.size()) == observations ? p : NistProblem{};
}

namespace {

struct Named {
  const char* name;
  Model model;
};
constexpr Named kProblems[] = {
    {"Misra1a", Model::misra1a},   {"Chwirut2", Model::chwirut}, {"Chwirut1", Model::chwirut},
    {"Lanczos3", Model::lanczos},  {"Gauss1", Model::gauss},     {"Gauss2", Model::gauss},
    {"DanWood", Model::danwood},   {"Misra1b", Model::misra1b},  {"Kirby2", Model::kirby2},
    {"Hahn1", Model::cubics},      {"Nelson", Model::nelson},    {"MGH17", Model::mgh17},
    {"Lanczos1", Model::lanczos},  {"Lanczos2", Model::lanczos}, {"Gauss3", Model::gauss},
    {"Misra1c", Model::misra1c},   {"Misra1d", Model::misra1d},  {"Roszman1", Model::roszman1},
    {"ENSO", Model::enso},         {"MGH09", Model::mgh09},      {"Thurber", Model::cubics},
    {"BoxBOD", Model::misra1a},    {"Rat42", Model::rat42},      {"MGH10", Model::mgh10},
    {"Eckerle4", Model::eckerle4}, {"Rat43", Model::rat43},      {"Bennett5", Model::bennett5},
};

struct Outcome {
  double digits = 0.0;
  bool finite = true;
  Summary summary;
};

// Of all parameters that give the same function the ones that NIST certified: exponentials in the order of their rates,
// widths that are only squared positive.
template <int N>
void make_canonical(Model model, Vec<double, N>& b) {
  if constexpr (N == 3) {
    if (model == Model::eckerle4 && b[1] < 0.0) b[0] = -b[0], b[1] = -b[1];
  } else if constexpr (N == 5) {
    if (model == Model::mgh17 && b[3] > b[4]) std::swap(b[1], b[2]), std::swap(b[3], b[4]);
  } else if constexpr (N == 6) {
    for (const int i : {1, 3, 1})
      if (b[i] > b[i + 2]) std::swap(b[i - 1], b[i + 1]), std::swap(b[i], b[i + 2]);
  } else if constexpr (N == 8) {
    b[4] = std::fabs(b[4]), b[7] = std::fabs(b[7]);
    if (b[3] > b[6])
      for (const int i : {2, 3, 4}) std::swap(b[i], b[i + 3]);
  }
}

template <int N>
Outcome fit(const NistProblem& problem, Model model, int start, Method method) {
  Graph graph;
  GraphEdit edit = graph.edit();
  VectorNd<N> b;
  for (int i = 0; i < N; ++i) b.v[i] = problem.start[start][static_cast<std::size_t>(i)];
  const auto id = edit.add(b);
  for (Observation o : problem.observations) {
    if (model == Model::nelson) o.y = std::log(o.y);
    edit.add(Fit<N>{model, o}, Sigma(1.0), id);
  }
  EXPECT_TRUE(graph.apply(edit));
  NativeEngine engine(graph);
  Outcome out;
  SolveOptions options;  // all others as they come
  options.method = method;
  out.summary = engine.solve(options);
  b = graph.value(id);
  make_canonical(model, b.v);
  double worst = 0.0;
  for (int i = 0; i < N; ++i) {
    const double certified = problem.certified[static_cast<std::size_t>(i)], found = b.v[i];
    out.finite = out.finite && std::isfinite(found);
    worst = std::max(worst, std::fabs((found - certified) / certified));
  }
  out.digits = std::isfinite(worst) ? std::clamp(-std::log10(worst), 0.0, 11.0) : 0.0;
  return out;
}

Outcome fit(const NistProblem& problem, Model model, int start, Method method) {
  switch (problem.certified.size()) {
    case 2:
      return fit<2>(problem, model, start, method);
    case 3:
      return fit<3>(problem, model, start, method);
    case 4:
      return fit<4>(problem, model, start, method);
    case 5:
      return fit<5>(problem, model, start, method);
    case 6:
      return fit<6>(problem, model, start, method);
    case 7:
      return fit<7>(problem, model, start, method);
    case 8:
      return fit<8>(problem, model, start, method);
    case 9:
      return fit<9>(problem, model, start, method);
    default:
      ADD_FAILURE() << "no model of " << problem.certified.size() << " parameters";
      return {};
  }
}

NistProblem problem_named(const char* name) {
  NistProblem p = read_problem(std::string(ORIEL_SOURCE_DIR "/tests/solve/nist/") + name + ".dat");
  EXPECT_FALSE(p.observations.empty()) << name;
  return p;
}

// The table of docs/benchmarks.md, where asked for.
void print(const Named& named, int start, const Outcome& out) {
  if (std::getenv("ORIEL_NIST_TABLE") != nullptr)
    std::printf("%s %d %.1f %d %s\n", named.name, start + 1, out.digits, out.summary.iterations,
                out.summary.reason_text().c_str());
}

void expect_all_digits(Method method) {
  double sum = 0.0;
  for (const Named& named : kProblems) {
    const NistProblem problem = problem_named(named.name);
    for (const int start : {0, 1}) {
      const Outcome out = fit(problem, named.model, start, method);
      EXPECT_TRUE(out.summary.converged()) << named.name << " from start " << start + 1 << '\n' << out.summary;
      EXPECT_GE(out.digits, 4.0) << named.name << " from start " << start + 1 << '\n' << out.summary;
      sum += out.digits;
      print(named, start, out);
    }
  }
  EXPECT_GE(sum / (2.0 * std::size(kProblems)), 9.0);
}

// L7
TEST(Nist, LevenbergMarquardtFindsAllCertifiedParametersFromBothStarts) {
  expect_all_digits(Method::levenberg_marquardt);
}

// L7
TEST(Nist, DoglegFindsAllCertifiedParametersFromBothStarts) { expect_all_digits(Method::dogleg); }

// L7
TEST(Nist, GaussNewtonFindsTheSameOptimumOrSaysThatItDiverges) {
  int found = 0;
  for (const Named& named : kProblems) {
    const NistProblem problem = problem_named(named.name);
    for (const int start : {0, 1}) {
      const Outcome out = fit(problem, named.model, start, Method::gauss_newton);
      EXPECT_TRUE(out.finite) << named.name;
      if (out.digits >= 4.0)
        ++found;
      else
        EXPECT_TRUE(out.summary.failed()) << named.name << " from start " << start + 1 << '\n' << out.summary;
      print(named, start, out);
    }
  }
  EXPECT_GE(found, 20);
}

}  // namespace
}  // namespace oriel::nist
