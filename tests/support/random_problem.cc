#include "linear/random_problem.h"

namespace oriel::testing {

RandomProblem::RandomProblem(unsigned seed) : random_(seed), edit_(graph.edit()) {}
RandomProblem::RandomProblem(RandomProblem&&) noexcept = default;
RandomProblem::~RandomProblem() = default;

RandomProblem::Rows::Rows() = default;
RandomProblem::Rows::Rows(Rows&&) noexcept = default;
RandomProblem::Rows& RandomProblem::Rows::operator=(Rows&&) noexcept = default;
RandomProblem::Rows::~Rows() = default;

FactorId RandomProblem::prior(const std::vector<VariableKey>& ids, const std::vector<int>& dims, int rows) {
  LinearPrior p;
  p.variables = ids;
  for (const int d : dims) p.cols += d;
  p.rows = rows;
  p.estimates.assign(static_cast<std::size_t>(p.cols), 0.0);
  for (int i = 0; i < rows; ++i) p.d.push_back(normal());
  for (int i = 0; i < rows * p.cols; ++i) p.R.push_back(normal());
  rows_.push_back([=](const Graph& g) {
    Rows out;
    Eigen::VectorXd x(p.cols);
    int c = 0;
    for (std::size_t k = 0; k < ids.size(); ++k) {
      const auto* v = static_cast<const double*>(g.find_value(ids[k]));
      for (int i = 0; i < dims[k]; ++i) x[c++] = v[i];
    }
    out.j = Eigen::Map<const Eigen::MatrixXd>(p.R.data(), rows, p.cols);
    out.r = Eigen::Map<const Eigen::VectorXd>(p.d.data(), rows) + out.j * x;
    out.cost = 0.5 * out.r.squaredNorm();
    out.ids = ids, out.dims = dims;
    return out;
  });
  return edit_.add(p);
}

Result<void> RandomProblem::apply() {
  auto result = graph.apply(edit_);
  edit_.clear();
  return result;
}

RandomProblem::Dense RandomProblem::dense(const LinearStructure& structure) const {
  Dense d{Eigen::MatrixXd::Zero(structure.dim(), structure.dim()), Eigen::VectorXd::Zero(structure.dim()), 0.0};
  for (const auto& f : rows_) {
    const Rows rows = f(graph);
    d.cost += rows.cost;
    for (std::size_t k = 0, c = 0; k < rows.ids.size(); c += static_cast<std::size_t>(rows.dims[k++])) {
      const int at = offset(structure, rows.ids[k]);
      if (at < 0) continue;
      const auto jk = rows.j.middleCols(static_cast<int>(c), rows.dims[k]);
      d.g.segment(at, rows.dims[k]) += jk.transpose() * rows.r;
      for (std::size_t m = 0, e = 0; m < rows.ids.size(); e += static_cast<std::size_t>(rows.dims[m++]))
        if (const int to = offset(structure, rows.ids[m]); to >= 0)
          d.h.block(at, to, rows.dims[k], rows.dims[m]) +=
              jk.transpose() * rows.j.middleCols(static_cast<int>(e), rows.dims[m]);
    }
  }
  return d;
}

int RandomProblem::offset(const LinearStructure& structure, VariableKey id) const {
  for (std::size_t p = 0; p < graph.pools().size(); ++p)
    if (graph.pools()[p]->ops().key == id.type)
      return structure.target(p, graph.pools()[p]->slots().find(id.key)).offset;
  return -1;
}

RandomProblem::Rows RandomProblem::whitened(const double* r, const double* j, int dim, int cols, double sigma,
                                            const Loss& loss) {
  Rows rows;
  rows.r = Eigen::Map<const Eigen::VectorXd>(r, dim) / sigma;
  rows.j = Eigen::Map<const Eigen::MatrixXd>(j, dim, cols) / sigma;
  const auto l = evaluate_loss(loss.kind, loss.scale, rows.r.squaredNorm());
  rows.cost = 0.5 * l.rho;
  rows.r *= std::sqrt(l.weight), rows.j *= std::sqrt(l.weight);
  return rows;
}

System::System(const Graph& graph, TaskPool* pool) {
  if (!structure.build(graph, {})) return;
  point.take(graph);
  linearizer.first_estimates = false;
  linearizer.evaluate(graph, structure, point, nullptr, active, pool);
  linearizer.linearize(graph, structure, point, &active, numbers, pool);
  schur.prepare(structure);
}

Eigen::VectorXd System::gradient() const {
  return Eigen::Map<const Eigen::VectorXd>(numbers.gradient.data(), structure.dim());
}

Eigen::VectorXd System::solve(const Eigen::VectorXd& damping, TaskPool* pool) {
  AlignedBuffer s;
  s.reserve(structure.factorization().storage_size());
  Eigen::VectorXd rhs(structure.kept_dim()), step(structure.dim());
  schur.reduce(structure, numbers, damping.data(), s.data(), rhs.data(), pool);
  structure.factorization().factor(s.data(), damping.data(), pool);
  structure.factorization().solve(rhs.data(), step.data());
  schur.back_substitute(structure, numbers, damping.data(), step.data(), pool);
  return step;
}

Eigen::VectorXd dense_step(const RandomProblem::Dense& d, const Eigen::VectorXd& damping) {
  return Eigen::MatrixXd(d.h + Eigen::MatrixXd(damping.asDiagonal())).llt().solve(-d.g);
}

}  // namespace oriel::testing
