#include "tools/bench/kernel_benchmark.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <limits>

#include "sim/core/parallel.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/terms/damper.h"
#include "sim/terms/element_loop.h"
#include "sim/terms/kernel_choice.h"
#include "tools/bench/kernel_cases.h"
#include "tools/bench/plain_skin.h"
#include "tools/bench/plain_surface.h"
#include "tools/bench/skin_operations.h"
#include "tools/bench/stage_times.h"
#include "tools/bench/timing.h"

namespace rhytid::tools {
namespace {

constexpr double allowed_difference = 1e-10;

/// Plain energy of an element with forces added, and its matrix.
using PlainResidual = std::function<double(const TermElement&, const double* u, double* f)>;
using PlainHessian = std::function<void(const TermElement&, const double* u, double* dense)>;

struct Row {
  std::string kernel, element, isa;
  double points = 0;
  double seconds = 0, seconds_all = 0, plain_seconds = 0;  ///< of all points; one thread, all, one
  double flops = 0;                                        ///< per point; 0 when not counted
  double difference = 0;             ///< from the plain one, relative to the largest entry
  double difference_by_points = -1;  ///< from the law one point at a time; < 0: there is none
};

void visit_elements(const KernelCase& c, const StepInfo& step,
                    const std::function<void(const TermElement&)>& visit) {
  for (std::size_t gi = 0; gi < c.term.groups().size(); ++gi) {
    const TermGroup& g = c.term.groups()[gi];
    for (int e = 0; e < g.num_elements; ++e)
      visit(term_element(c.term.kernels(), g, e, step.dt(), c.data.theta[gi]));
  }
}

/// What one writes at first for a whole mesh: energy, forces added up.
double plain_residual(const KernelCase& c, const KernelCases& all, const PlainResidual& element,
                      VectorXd& force) {
  double energy = 0;
  std::vector<double> f;
  visit_elements(c, all.step(), [&](const TermElement& e) {
    const NodalValues u = e.gather(all.displacement());
    f.assign(static_cast<std::size_t>(3 * e.view.num_nodes), 0.0);
    energy += element(e, u.data(), f.data());
    const int* nodes = e.group.nodes.data() + static_cast<std::size_t>(e.index) * e.group.num_nodes;
    for (int i = 0; i < e.view.num_nodes; ++i) force.segment<3>(3 * nodes[i]) += Eigen::Map<Vec3>(&f[3 * i]);
  });
  return energy;
}

/// Infinite where either is not finite, which maxima would pass over.
double relative_difference(const VectorXd& a, const VectorXd& b) {
  if (!a.allFinite() || !b.allFinite()) return std::numeric_limits<double>::infinity();
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

double residual_difference(const KernelCase& c, const KernelCases& all, const PlainResidual& element) {
  VectorXd force = VectorXd::Zero(all.displacement().size()), plain = force;
  const double energy = c.term.energy(all.step(), c.data, all.displacement(), &force, nullptr);
  const double plain_energy = plain_residual(c, all, element, plain);
  return std::max(std::abs(energy / plain_energy - 1), relative_difference(force, plain));
}

/// Compares element matrices as they come.
class Comparison final : public Term::MatrixSink {
 public:
  Comparison(const KernelCase& c, const KernelCases& all, const PlainHessian& plain)
      : case_(c), all_(all), plain_(plain) {}
  void add(const TermGroup& group, int element, double* dense) override {
    const std::size_t gi = static_cast<std::size_t>(&group - case_.term.groups().data());
    const TermElement e =
        term_element(case_.term.kernels(), group, element, all_.step().dt(), case_.data.theta[gi]);
    VectorXd other(9 * e.view.num_nodes * e.view.num_nodes);
    plain_(e, e.gather(all_.displacement()).data(), other.data());
    largest_ =
        std::max(largest_, relative_difference(Eigen::Map<const VectorXd>(dense, other.size()), other));
  }
  double largest() const { return largest_; }

 private:
  const KernelCase& case_;
  const KernelCases& all_;
  const PlainHessian& plain_;
  double largest_ = 0;
};

double hessian_difference(const KernelCase& c, const KernelCases& all, const PlainHessian& element) {
  Comparison comparison(c, all, element);
  c.term.hessian(all.step(), c.data, all.displacement(), false, comparison);
  return comparison.largest();
}

class NoSink final : public Term::MatrixSink {
 public:
  void add(const TermGroup&, int, double* dense) override { seen_ += dense[0]; }

 private:
  double seen_ = 0;
};

std::string text(double value, const char* pattern = "%.3g") {
  char out[32];
  std::snprintf(out, sizeof out, pattern, value);
  return out;
}

class Measurement {
 public:
  Measurement(double seconds, VerbContext& context, std::string folder)
      : seconds_(seconds), context_(context), folder_(std::move(folder)), threads_(num_threads()) {}
  ~Measurement() { set_num_threads(threads_); }
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;

  bool go_on() const { return !context_.progress.interrupted(); }
  bool all_agree() const { return all_agree_; }

  /// Measures the machine anew, so that shares are of what it gives just now.
  void measure_machine() { machine_ = measure_machine_limits(); }

  /// Times a kernel with one and all threads and its plain reference in turn, unless they disagree.
  void add(Row row, const std::function<void()>& kernel, const std::function<void()>& plain) {
    if (!go_on()) return;
    if (row.difference < allowed_difference) {
      const auto use = [](int count) { return [count] { set_num_threads(count); }; };
      const std::vector<double> times = median_seconds_in_turn(
          seconds_, {{kernel, use(1), true}, {kernel, use(threads_)}, {plain, use(1), true}},
          [&] { return go_on(); });
      set_num_threads(threads_);
      row.seconds = times[0];
      row.seconds_all = times[1];
      row.plain_seconds = times[2];
    } else {
      all_agree_ = false;
      context_.progress.error(row.kernel + " of " + row.element + " (" + row.isa +
                              ") differs from its plain reference by " + text(row.difference));
    }
    rows_.push_back(row);
    machines_.push_back(machine_);
    write();
  }

  void add_residual(const KernelCase& c, const KernelCases& all, Row row, const PlainResidual& element) {
    row.kernel = c.name + ": residual";
    row.element = all.element();
    row.points = c.term.num_points();
    row.difference = residual_difference(c, all, element);
    VectorXd force = VectorXd::Zero(all.displacement().size());
    add(
        row, [&] { (void)c.term.energy(all.step(), c.data, all.displacement(), &force, nullptr); },
        [&] { (void)plain_residual(c, all, element, force); });
  }
  void add_hessian(const KernelCase& c, const KernelCases& all, Row row, const PlainHessian& element) {
    row.kernel = c.name + ": Hessian";
    row.element = all.element();
    row.points = c.term.num_points();
    row.difference = hessian_difference(c, all, element);
    NoSink sink;
    std::vector<double> dense(9 * kMaxElementNodes * kMaxElementNodes);
    add(
        row, [&] { c.term.hessian(all.step(), c.data, all.displacement(), false, sink); },
        [&] {
          visit_elements(c, all.step(), [&](const TermElement& e) {
            element(e, e.gather(all.displacement()).data(), dense.data());
          });
        });
  }

  std::string markdown() const {
    std::string out =
        "| kernel | elements | instructions | points | ns per point, 1 thread | " + std::to_string(threads_) +
        " threads | plain Eigen | times faster | flops per point | of FMA peak | difference | from scalar |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const Row& r = rows_[k];
      const double per_point = 1e9 / r.points;
      out += "| " + r.kernel + " | " + r.element + " | " + r.isa + " | " + text(r.points, "%.0f") + " | " +
             text(r.seconds * per_point) + " | " + text(r.seconds_all * per_point) + " | " +
             text(r.plain_seconds * per_point) + " | " + text(ratio(r)) + " | " +
             (r.flops > 0 ? text(r.flops, "%.0f") : "") + " | " +
             (share(k) > 0 ? text(100 * share(k), "%.0f %%") : "") + " | " + text(r.difference, "%.1e") +
             " | " + (r.difference_by_points < 0 ? "" : text(r.difference_by_points, "%.1e")) + " |\n";
    }
    return out;
  }

 private:
  static double ratio(const Row& r) { return r.seconds > 0 ? r.plain_seconds / r.seconds : 0; }
  /// Of one core in vectors of the row's instructions; of AVX2 for the portable ones.
  double peak(std::size_t k) const {
    return rows_[k].isa == "avx512" ? machines_[k].fma_flops : machines_[k].fma_flops_avx2;
  }
  /// Of one core's peak, on one thread.
  double share(std::size_t k) const {
    const Row& r = rows_[k];
    return r.flops > 0 && r.seconds > 0 && peak(k) > 0 ? r.flops * r.points / r.seconds / peak(k) : 0;
  }
  void write() const {
    CsvTable csv({{"kernel", ""},
                  {"elements", ""},
                  {"instructions", ""},
                  {"points", ""},
                  {"time_per_point", "ns"},
                  {"threads", ""},
                  {"time_per_point_all_threads", "ns"},
                  {"plain_time_per_point", "ns"},
                  {"times_faster", ""},
                  {"flops_per_point", ""},
                  {"fma_peak", "GFLOP/s"},
                  {"share_of_fma_peak", ""},
                  {"difference", ""},
                  {"difference_from_scalar", ""}});
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const Row& r = rows_[k];
      const double per_point = 1e9 / r.points;
      csv.add_row({r.kernel, r.element, r.isa, r.points, r.seconds * per_point, std::int64_t{threads_},
                   r.seconds_all * per_point, r.plain_seconds * per_point, ratio(r), r.flops, peak(k) / 1e9,
                   share(k), r.difference,
                   r.difference_by_points < 0 ? CsvCell(std::string()) : CsvCell(r.difference_by_points)});
    }
    csv.write(folder_ + "/kernels.csv");
    write_file(folder_ + "/kernels.md", markdown());
  }

  double seconds_;
  VerbContext& context_;
  std::string folder_;
  int threads_;
  MachineLimits machine_;
  std::vector<Row> rows_;
  std::vector<MachineLimits> machines_;  ///< beside each row
  bool all_agree_ = true;
};

void measure_skin(const KernelCases& all, const std::string& isa, const KernelTable& kernels,
                  const PlainSkin& plain, Measurement& out) {
  const KernelCase c = all.skin(kernels);
  const SkinLaw law = all.skin_law();
  const auto prepared = [&](const TermElement& e) { return c.data.prepared.data() + 6 * e.point; };
  const double weight = damper(law.scheme, c.data.theta[0][SkinTheta::tau], all.step().dt()).weight;
  const TermElement first =
      term_element(c.term.kernels(), c.term.groups()[0], 0, all.step().dt(), c.data.theta[0]);
  const SkinOperations operations =
      count_skin_operations(law, first.view, first.gather(all.displacement()).data(), prepared(first));
  Row row;
  row.isa = isa;
  row.flops = operations.residual;
  row.difference_by_points =
      residual_difference(c, all, [&](const TermElement& e, const double* u, double* f) {
        return skin_residual_by_points(law, e.view, u, prepared(e), f);
      });
  out.add_residual(c, all, row, [&](const TermElement& e, const double* u, double* f) {
    return plain.residual(weight, e.view, u, prepared(e), f);
  });
  row.flops = operations.hessian;
  row.difference_by_points =
      hessian_difference(c, all, [&](const TermElement& e, const double* u, double* dense) {
        skin_hessian_by_points(law, e.view, u, prepared(e), dense);
      });
  out.add_hessian(c, all, row, [&](const TermElement& e, const double* u, double* dense) {
    plain.hessian(weight, e.view, u, prepared(e), dense);
  });
}

void measure_surface(const KernelCases& all, const KernelCase& c,
                     const std::function<PlainSurfaceLaw(const TermElement&)>& law, Measurement& out) {
  Row row;
  row.isa = "baseline";
  out.add_residual(c, all, row, [&](const TermElement& e, const double* u, double* f) {
    return plain_surface_residual(law(e), e.view, u, f);
  });
  out.add_hessian(c, all, row, [&](const TermElement& e, const double* u, double* dense) {
    plain_surface_hessian(law(e), e.view, u, dense);
  });
}

void measure_imls(int cells, Measurement& out) {
  const ImlsCase c = imls_case(cells);
  const PlainImls plain(c.points, c.normals, c.surface->support());
  const auto places = c.places.rows();
  std::vector<double> gaps(static_cast<std::size_t>(places));
  Row row;
  row.kernel = "IMLS bone: gap and derivatives";
  row.isa = "baseline";
  row.points = static_cast<double>(places);
  for (Eigen::Index i = 0; i < places; ++i) {
    const Vec3 x = c.places.row(i).transpose();
    const GapJet a = c.surface->evaluate(x), b = plain.evaluate(x);
    row.difference =
        std::max({row.difference, std::abs(a.gap - b.gap), (a.gradient - b.gradient).cwiseAbs().maxCoeff(),
                  (a.hessian - b.hessian).cwiseAbs().maxCoeff()});
  }
  out.add(
      row,
      [&] {
        parallel_for(places, [&](std::int64_t i) {
          gaps[static_cast<std::size_t>(i)] = c.surface->evaluate(c.places.row(i).transpose()).gap;
        });
      },
      [&] {
        for (Eigen::Index i = 0; i < places; ++i)
          gaps[static_cast<std::size_t>(i)] = plain.evaluate(c.places.row(i).transpose()).gap;
      });
}

class KernelBenchmark : public Benchmark {
 public:
  BenchmarkHelp help() const override {
    return {
        "kernels", "the element kernels beside the same sums written plainly with Eigen",
        "Times energy with forces and element matrices of viscoelastic skin (P4 x P2 and P3 x P3, kernels "
        "for "
        "every instruction set of this machine), ligaments, contact, friction and IMLS bone, with one and "
        "all "
        "threads, in turn with plain loops over elements and points (Eigen's 3 x 3 matrices, its iterative "
        "eigensolver, a dense B^T D B) compiled for the same instruction set, on one thread. Before that "
        "both "
        "must agree to 1e-10. Operations are counted, not estimated, and set beside the fused multiply-adds "
        "that one core does in the same run in vectors of the same width (of AVX2 for portable kernels). "
        "Writes kernels.csv and kernels.md into -o DIR."};
  }
  void add_options(CLI::App& app) override {
    app.add_option("--cells", cells_, "the patch has N x N squares of two elements (default 12)")
        ->option_text("N")
        ->check(CLI::Range(1, 1000));
    app.add_option("--seconds", seconds_, "how long every call is repeated (default 1)")
        ->check(CLI::Range(0., 3600.));
  }

  ExitCode run(VerbContext& context, const std::string& folder) override {
    Measurement measurement(seconds_, context, folder);
    struct Compiled {
      std::string isa;
      const KernelTable* kernels;
      const PlainSkin* plain;
    };
    std::vector<Compiled> compiled = {{"baseline", skin_kernels_of("baseline"), &plain_skin_baseline}};
#ifdef RHYTID_HAVE_AVX2
    compiled.push_back({"avx2", skin_kernels_of("avx2"), &plain_skin_avx2});
#endif
#ifdef RHYTID_HAVE_AVX512
    compiled.push_back({"avx512", skin_kernels_of("avx512"), &plain_skin_avx512});
#endif
    const KernelCases p4(4, 2, cells_), p3(3, 3, cells_);
    for (const KernelCases* all : {&p4, &p3}) {
      context.progress.stage(all->element(), 1);
      measurement.measure_machine();
      for (const Compiled& c : compiled)
        if (c.kernels) measure_skin(*all, c.isa, *c.kernels, *c.plain, measurement);
      measure_surface(
          *all, all->ligaments(), [](const TermElement&) { return plain_ligament(); }, measurement);
      measure_surface(
          *all, all->contact(),
          [&](const TermElement&) { return plain_sphere_contact(all->contact_radius(), KernelCases::onset); },
          measurement);
      const KernelCase friction = all->friction();
      measure_surface(
          *all, friction,
          [&](const TermElement& e) {
            return plain_friction(KernelCases::slip_speed, friction.data.prepared.data() + 7 * e.point);
          },
          measurement);
      context.progress.finish();
    }
    measure_imls(cells_, measurement);
    if (!measurement.go_on()) return ExitCode::interrupted;
    context.out << measurement.markdown() << "\n" << folder << "/kernels.csv\n";
    return measurement.all_agree() ? ExitCode::ok : ExitCode::not_converged;
  }

 private:
  int cells_ = 12;
  double seconds_ = 1;
};

}  // namespace

std::unique_ptr<Benchmark> make_kernel_benchmark() {
  return std::make_unique<KernelBenchmark>();
}

}  // namespace rhytid::tools
