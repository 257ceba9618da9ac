#include "client/report.h"

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/exit_code.h"
#include "client/progress.h"
#include "client/status.h"

namespace strata::client {
namespace {

using nlohmann::json;

json to_json(const v1::JacobianStatistics& s) {
  return {{"count", s.count()},
          {"min", s.min()},
          {"mean", s.mean()},
          {"not_positive", s.not_positive()},
          {"histogram", std::vector<std::int64_t>(s.histogram().begin(), s.histogram().end())}};
}

json to_json(const v1::PatchStatistics& p) {
  json j{{"name", p.name()},
         {"reference", p.reference()},
         {"quads", p.quads()},
         {"area", p.area()},
         {"scaled_jacobian", to_json(p.jacobian())}};
  if (p.layers_wished() > 0)
    j["layers"] = {{"wished", p.layers_wished()},
                   {"count", p.layers()},
                   {"first_height_wished", p.first_height_wished()},
                   {"first_height_mean", p.first_height_mean()},
                   {"thickness_fraction_mean", p.thickness_fraction_mean()},
                   {"thickness_fraction_min", p.thickness_fraction_min()},
                   {"coverage", p.coverage()}};
  return j;
}

json to_json(const v1::Quality& q) {
  json regions = json::array(), patches = json::array();
  for (const auto& r : q.regions())
    regions.push_back(
        {{"reference", r.reference()}, {"hexes", r.hexes()}, {"volume", r.volume()}, {"scaled_jacobian", to_json(r.jacobian())}});
  for (const auto& p : q.patches()) patches.push_back(to_json(p));
  return {{"scaled_jacobian", {{"all", to_json(q.all())}, {"layers", to_json(q.layers())}, {"rest", to_json(q.rest())}}},
          {"regions", regions},
          {"patches", patches},
          {"vertices", q.vertices()},
          {"quads", q.quads()}};
}

}  // namespace

json to_json(const v1::Diagnostic& d) {
  json j{{"reason", d.reason()}, {"severity", lower_name(v1::Severity_Name(d.severity()), "SEVERITY_")}, {"message", d.message()}};
  if (!d.patch().empty()) j["patch"] = d.patch();
  if (!d.field().empty()) j["field"] = d.field();
  if (d.triangles_size() > 0) j["triangles"] = std::vector<std::int64_t>(d.triangles().begin(), d.triangles().end());
  if (d.count() > 0) j["count"] = d.count();
  if (d.has_box()) {
    const auto& a = d.box().min();
    const auto& b = d.box().max();
    j["box"] = {{a.x(), a.y(), a.z()}, {b.x(), b.y(), b.z()}};
  }
  json values = json::object();
  for (const auto& [name, value] : d.values()) values[name] = value;
  if (!values.empty()) j["values"] = values;
  return j;
}

json report(const v1::Job& job) {
  json patches = json::object(), stages = json::array(), adjustments = json::array();
  for (const auto& p : job.patches()) patches[p.name()] = p.reference();
  for (const auto& s : job.stages())
    stages.push_back({{"stage", stage_name(s.stage())},
                      {"seconds", s.seconds()},
                      {"cpu_seconds", s.cpu_seconds()},
                      {"peak_memory_bytes", s.peak_memory_bytes()}});
  for (const auto& a : job.adjustments()) adjustments.push_back(to_json(a));
  return {{"job", job.job_id()},
          {"generator", job.generator()},
          {"rung", rung_name(job.rung())},
          {"hexes", job.hexes()},
          {"layer_hexes", job.layer_hexes()},
          {"patches", patches},
          {"quality", to_json(job.quality())},
          {"stages", stages},
          {"adjustments", adjustments},
          {"adjustments_total", job.adjustments_total()},
          {"usage",
           {{"queue_seconds", job.usage().queue_seconds()},
            {"wall_seconds", job.usage().wall_seconds()},
            {"cpu_seconds", job.usage().cpu_seconds()},
            {"peak_memory_bytes", job.usage().peak_memory_bytes()},
            {"threads", job.threads()}}}};
}

void write_report(const v1::Job& job, const std::string& path) {
  const std::string part = path + ".part";
  std::ofstream out(part);
  out << report(job).dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  out.close();
  std::error_code error;
  if (!out) error = std::make_error_code(static_cast<std::errc>(errno));
  else std::filesystem::rename(part, path, error);
  if (error) throw CommandError(ExitCode::LocalIo, "cannot write the report '" + path + "': " + error.message());
}

std::string summary(const v1::Job& job) {
  std::ostringstream out;
  const auto line = [&](const char* pattern, auto... values) {
    char text[256];
    std::snprintf(text, sizeof text, pattern, values...);
    out << printable(text) << '\n';
  };
  const auto number = [](std::int64_t n) { return static_cast<long long>(n); };
  const v1::Quality& q = job.quality();
  line("hexes      %lld, %lld of them in layers", number(job.hexes()), number(job.layer_hexes()));
  line("quality    scaled Jacobian min %.4f mean %.4f (layers %.4f %.4f, rest %.4f %.4f)", q.all().min(), q.all().mean(), q.layers().min(),
       q.layers().mean(), q.rest().min(), q.rest().mean());
  for (const auto& p : q.patches())
    if (p.layers_wished() > 0)
      line("layers     %-16s %2d on %5.1f %% of the area, first height %.4g of %.4g, thickness %3.0f %%", p.name().c_str(), p.layers(),
           100 * p.coverage(), p.first_height_mean(), p.first_height_wished(), 100 * p.thickness_fraction_mean());
  line("rung       %s, %lld notes", rung_name(job.rung()).c_str(), number(job.adjustments_total()));
  line("time       %.2f s, %.2f CPU s, %.0f MB, %d threads", job.usage().wall_seconds(), job.usage().cpu_seconds(),
       1e-6 * static_cast<double>(job.usage().peak_memory_bytes()), job.threads());
  return out.str();
}

}  // namespace strata::client
