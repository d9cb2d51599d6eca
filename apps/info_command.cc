// oriel info FILE: what can be said of a problem before it is solved.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/arguments.h"
#include "apps/batch_problem.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "oriel/io/problem_facts.h"

namespace oriel::apps {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kComponentsShown = 10;

struct InfoArguments {
  std::string file, json, isam_noise = "information";
};

const char* format_of(const ProblemFile& file) {
  const auto* graph = std::get_if<PoseGraphFile>(&file);
  if (graph == nullptr) return "bal";
  return graph->spelling == PoseGraphSpelling::g2o    ? "g2o"
         : graph->spelling == PoseGraphSpelling::toro ? "toro"
                                                      : "isam";
}

int dimension_of(const ProblemFile& file) {
  const auto* graph = std::get_if<PoseGraphFile>(&file);
  return graph != nullptr && !graph->is_3d ? 2 : 3;
}

Json spread_json(const ProblemFacts::Spread& s) {
  return {{"min", s.least}, {"median", s.median}, {"max", s.most}, {"mean", s.mean}};
}

std::string facts_json(const std::string& path, const ProblemFile& file, const ProblemFacts& f) {
  Json o;
  o["file"] = path;
  o["format"] = format_of(file);
  o["dimension"] = dimension_of(file);
  for (const auto& c : f.counts) o["counts"][c.what] = c.count;
  o["pose_degree"] = spread_json(f.pose_degree);
  o["landmark_degree"] = spread_json(f.landmark_degree);
  o["poses_alone"] = f.poses_alone;
  o["landmarks_seen_once"] = f.landmarks_once;
  o["component_count"] = f.components.size();
  o["components"] = Json::array();
  for (std::size_t k = 0; k < std::min(f.components.size(), kComponentsShown); ++k) {
    const auto& c = f.components[k];
    o["components"].push_back({{"poses", c.poses}, {"landmarks", c.landmarks}, {"first", c.first}, {"free", c.free}});
  }
  o["start"] = f.start;
  o["cost"] = f.cost;
  o["suspicious"] = {{"self", 0}, {"repeated", 0}, {"indefinite", 0}, {"far", 0}};
  for (const auto& c : f.suspicious) o["suspicious"][c.what] = c.count;
  o["examples"] = Json::array();
  for (const auto& e : f.examples) {
    Json example = {{"kind", e.kind}, {"line", e.line}, {"edge", e.what}};
    if (e.kind == "far") example["sigmas"] = e.sigmas;
    o["examples"].push_back(std::move(example));
  }
  return o.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string spread_text(const char* what, const ProblemFacts::Spread& s) {
  return fmt::format("  {}: {} to {}, median {}, mean {:.2f}\n", what, s.least, s.most, s.median, s.mean);
}

std::string components_text(const ProblemFacts& f) {
  std::string out = fmt::format("  components: {}\n", f.components.size());
  for (std::size_t k = 0; k < std::min(f.components.size(), kComponentsShown); ++k) {
    const auto& c = f.components[k];
    out += fmt::format("    {} poses, {} landmarks, from {} on; free: {}\n", c.poses, c.landmarks, c.first,
                       c.free.empty() ? "nothing" : c.free);
  }
  if (f.components.size() > kComponentsShown) out += "    ...\n";
  return out;
}

std::string suspicious_text(const ProblemFacts& f) {
  static const std::map<std::string, const char*> kWords = {
      {"self", "edges from a pose to itself, left out"},
      {"repeated", "edges between two that have one already, kept"},
      {"indefinite", "edges whose information has a negative eigenvalue"},
      {"far", "edges too far off for their sigmas (once in 1e9 by chance)"}};
  std::string out;
  for (const auto& c : f.suspicious) {
    out += fmt::format("  {}: {}\n", kWords.at(c.what), c.count);
    for (const auto& e : f.examples) {
      if (e.kind != c.what) continue;
      out += fmt::format("    line {}{}{}", e.line, e.what.empty() ? "" : ": ", e.what);
      out += e.kind == "far" ? fmt::format(", {:.3g} sigmas\n", e.sigmas) : "\n";
    }
  }
  return out.empty() ? "  suspicious: nothing\n" : out;
}

std::string facts_text(const std::string& path, const ProblemFile& file, const ProblemFacts& f) {
  std::string out = fmt::format("{}: {}, {}D\n", path, format_of(file), dimension_of(file));
  for (const auto& c : f.counts) out += fmt::format("  {}: {}\n", c.what, c.count);
  out += spread_text("edges of a pose", f.pose_degree);
  if (f.landmark_degree.most > 0) out += spread_text("sightings of a landmark", f.landmark_degree);
  if (f.poses_alone > 0) out += fmt::format("  poses without an edge: {}\n", f.poses_alone);
  if (f.landmarks_once > 0) out += fmt::format("  landmarks seen once: {}\n", f.landmarks_once);
  out += components_text(f);
  out += fmt::format("  cost {:.6g} over {} edges, at the values of {}\n", f.cost, f.edges,
                     f.start == "file" ? "the file" : "chained odometry");
  return out + suspicious_text(f);
}

Result<void> inform(const InfoArguments& a) {
  if (auto ok = check_target(a.json); !ok) return ok;
  PoseGraphReading reading;
  reading.project_information = true;  // counted and named instead of refused
  if (a.isam_noise == "root") reading.isam_noise = IsamNoise::root;
  if (a.isam_noise == "covariance") reading.isam_noise = IsamNoise::covariance;
  const Result<ProblemFile> file = read_problem(a.file, reading);
  if (!file) return file.error();
  const ProblemFacts facts = std::visit([](const auto& f) { return facts_of(f); }, *file);
  if (a.json != "-")
    if (auto ok = write_output("-", facts_text(a.file, *file, facts)); !ok) return ok;
  return a.json.empty() ? Result<void>() : write_output(a.json, facts_json(a.file, *file, facts));
}

int run(const InfoArguments& a) {
  const Result<void> done = inform(a);
  return done ? kSolved : refuse(done.error());
}

}  // namespace

void add_info_command(CLI::App& app, int& exit_code) {
  const auto a = std::make_shared<InfoArguments>();
  CLI::App* command = app.add_subcommand("info", "What a problem file holds, and which of its lines look wrong");
  command->add_option("FILE", a->file, "A problem file, as for solve")->required();
  command->add_option("--isam-noise", a->isam_noise, "What the last numbers of iSAM's lines are")
      ->check(one_of({"information", "root", "covariance"}))
      ->capture_default_str();
  command->add_option("--json", a->json, "The same as one object; - is standard output");
  command->callback([a, &exit_code] { exit_code = run(*a); });
}

}  // namespace oriel::apps
