// One solve: the main loop, and its stages as verbs.
#pragma once
#include "oriel/solve/defaults.h"
#include "oriel/solve/native_engine.h"

namespace oriel {

class Minimizer {
 public:
  Minimizer(NativeEngine& engine, const SolveOptions& options);
  Summary run();

 private:
  bool start();
  void name_linear_solver();
  bool iterate();
  void evaluate(const Point& point, const ActiveSet* frozen, ActiveSet& out);
  void linearize();
  bool find_step();
  bool find_dogleg_step();
  bool solve_linear();
  bool solve_directly();
  bool solve_by_conjugate_gradient();
  void step_to_trial();
  double predicted_gain() const;
  bool accept(double trial_cost, double gain);
  void reject();
  bool converged_by_cost(double decrease);
  bool step_is_tiny();
  // Steps that a trust region cuts short say nothing of how near the minimum is, but for several in a row.
  bool is_cut() const { return options_.method == Method::dogleg && e_.dogleg_.is_cut(); }
  bool out_of_time();
  bool report(bool accepted);
  void stop(Reason reason, double value, double bound);
  void finish();
  void name_not_finite();
  bool has_weak_landmark() const;
  template <class F>
  void for_each_pivot(F f) const;
  std::pair<int, double> smallest_pivot() const;
  bool may_have_gauge();
  void find_undetermined();
  std::vector<int> hold_null_scalars(const double* h);
  void name_undetermined(const double* h, const std::vector<int>& null);
  double now() const;
  double seconds() const { return now() - began_; }

  // Adds the time of its life to a stage.
  class Stage {
   public:
    Stage(const Minimizer& m, double& sum) : m_(m), sum_(sum), from_(m.seconds()) {}
    ~Stage() { sum_ += m_.seconds() - from_; }

   private:
    const Minimizer& m_;
    double& sum_;
    double from_;
  };

  NativeEngine& e_;
  const SolveOptions& options_;
  Settled settled_;  // of those that were left open
  Summary summary_;
  TaskPool* pool_ = nullptr;
  double began_;                       // [s]
  std::int64_t fallbacks_before_ = 0;  // the linearizer counts on over all solves
  double cost_ = 0.0, lambda_ = 0.0, nu_ = 2.0;
  double factored_lambda_ = 0.0;  // of the last factorization
  // Where hardly anything determines some direction, the whole step promises what no region ever keeps (BAL 49).
  static constexpr int kSmallInARow = 5;
  int small_in_a_row_ = 0;  // accepted steps that gained next to nothing
  bool begun_ = false;      // the dogleg of this linearization
  bool evaluated_ = false;  // whether the start has a cost
  bool stopped_ = false, suspicious_ = false;
  bool solved_ = false;  // the last linear system had a solution
};

}  // namespace oriel
