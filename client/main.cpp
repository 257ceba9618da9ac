// strata: the command line. Parses, calls one command, turns errors into messages and exit statuses.
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <functional>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/completion.h"
#include "client/exit_code.h"
#include "client/interrupt.h"
#include "client/manual.h"
#include "client/status.h"
#include "client/version.h"

namespace strata::client {
namespace {

constexpr int kMmapThreshold = 256 << 20;  // receiving megabyte frames with the default costs a page fault per 4 KiB
constexpr int kTrimThreshold = 1 << 30;

const std::map<std::string, double> kTimeUnits{{"s", 1}, {"min", 60}, {"h", 3600}, {"d", 86400}};
const std::map<std::string, Packing> kPackings{{"auto", Packing::Auto}, {"always", Packing::Always}, {"never", Packing::Never}};
const std::map<std::string, Output> kOutputs{{"table", Output::Table}, {"json", Output::Json}, {"name", Output::Name}};

void add_global(CLI::App& app, GlobalOptions& global, std::string& output, std::string& packing) {
  app.set_version_flag("--version", std::string("strata ") + kVersion, "Print the version and exit");
  app.add_option("--server", global.server,
                 "Address of stratad: host:port or unix:/path. Default: a private server for the time of the command")
      ->type_name("ADDRESS")
      ->envname("STRATA_SERVER");
  app.add_option("--tls-ca", global.tls_ca, "CA certificate (PEM) to verify the server with; turns TLS on")
      ->envname("STRATA_TLS_CA")
      ->check(CLI::ExistingFile);
  app.add_option("--tls-cert", global.tls_cert, "Client certificate (PEM)")->envname("STRATA_TLS_CERT")->check(CLI::ExistingFile);
  app.add_option("--tls-key", global.tls_key, "Key of the client certificate (PEM)")->envname("STRATA_TLS_KEY")->check(CLI::ExistingFile);
  app.add_option("--server-name", global.server_name, "Name in the server's certificate, when it differs from the address")
      ->type_name("NAME");
  app.add_option("--token-file", global.token_file, "File with the token or key that says who calls")
      ->type_name("FILE")
      ->envname("STRATA_TOKEN_FILE")
      ->check(CLI::ExistingFile);
  app.add_option("--timeout", global.timeout_seconds, "Seconds the command may take; a job on a server goes on")
      ->envname("STRATA_TIMEOUT")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--retry", global.retries, "Tries without progress before giving up")->capture_default_str()->check(CLI::Range(0, 1000));
  app.add_option("-o,--output-format", output, "Form of the output")->check(CLI::IsMember({"table", "json", "name"}))->type_name("FORM");
  app.add_option("--compress", packing, "Pack what is sent and received: auto (unless the server is on this machine), always or never")
      ->check(CLI::IsMember({"auto", "always", "never"}))
      ->type_name("WHEN");
  app.add_flag("-q,--quiet", global.quiet, "Errors only");
  app.add_flag("--no-progress", global.no_progress, "One line a stage instead of a block that is redrawn");
}

CLI::App* job_command(CLI::App& app, const std::string& name, const std::string& help, JobOptions& options) {
  CLI::App* command = app.add_subcommand(name, help);
  command->add_option("JOB", options.jobs, "Job id")->required()->type_name("");
  return command;
}

void print_error(const CommandError& error, const GlobalOptions& global) {
  if (global.output == Output::Json) {
    nlohmann::json j{
        {"code", static_cast<int>(error.code())}, {"reason", error.reason()}, {"message", error.what()}, {"hint", error.hint()}};
    j["details"] = error.details().empty() ? nlohmann::json::array() : nlohmann::json::parse(error.details());
    std::cerr << safe_dump(j) << '\n';
    return;
  }
  std::cerr << "strata: " << error.what() << '\n';
  if (!error.hint().empty()) std::cerr << "  " << error.hint() << '\n';
}

// Of a command line that makes no sense. CLI11 knows what is missing, but not that a word was meant as a command.
int complain(const CLI::App& app, const CLI::ParseError& error) {
  std::cerr << "strata: ";
  const std::vector<std::string> left = app.remaining();
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError) && app.get_subcommands().empty() && !left.empty())
    std::cerr << "there is no command '" << printable(left.front()) << "'\n";
  else std::cerr << printable(error.what()) << '\n';
  std::cerr << "  strata --help lists the commands, strata COMMAND --help their options\n";
  return static_cast<int>(ExitCode::Usage);
}

int run(int argc, char** argv) {
  CLI::App app{"All-hexahedral meshes with boundary layers.\nstrata mesh SURFACE --spec SPEC.json -o OUT.vtu does the whole job."};
  app.name("strata");
  app.require_subcommand(1);
  app.fallthrough();
  GlobalOptions global;
  MeshOptions meshing;
  JobOptions jobs;
  bool of_server = false;
  std::string shell, output = "table", packing = "auto", wait_for = "succeeded";
  add_global(app, global, output, packing);

  const auto surface_and_spec = [&](CLI::App* command) {
    command->add_option("SURFACE", meshing.surface, "Surface: .stl, .obj, .off, .ply, .mesh or .meshb")->required()->type_name("");
    command->add_option("--spec", meshing.spec, "Specification (JSON or YAML); default: sizes from the bounding box, no layers")
        ->type_name("FILE");
    command->add_option("--threads", global.threads, "Threads for the job; the mesh does not depend on it")->check(CLI::Range(1, 4096));
  };
  const auto naming = [&](CLI::App* command) {
    command->add_option("--name", meshing.name, "Name of the job, for people; default: that of the surface")->type_name("NAME");
    command->add_option("--label", meshing.labels, "Label of the job, KEY=VALUE; may be repeated")->type_name("LABEL");
    command->add_option("--priority", meshing.priority, "Before (up to 10) or after (down to -10) your other jobs")
        ->check(CLI::Range(-10, 10))
        ->capture_default_str();
    command->add_option("--keep", meshing.keep_seconds, "How long the results stay, such as 12h; default: what the server gives")
        ->transform(CLI::AsNumberWithUnit(kTimeUnits, CLI::AsNumberWithUnit::CASE_SENSITIVE))
        ->type_name("DURATION");
    command->add_option("--request-id", meshing.request_id, "The same id again gives the same job: safe to repeat after a crash")
        ->type_name("ID");
  };
  CLI::App* mesh_command = app.add_subcommand("mesh", "Mesh a surface: upload, run, watch, download, verify");
  surface_and_spec(mesh_command);
  naming(mesh_command);
  mesh_command->add_option("-o,--out", meshing.out, "Mesh to write: .vtu, .vtk, .mesh or .meshb")->required()->type_name("FILE");
  mesh_command
      ->add_option("--report", meshing.report, "Report to write (JSON): patches, quality, stages, where the mesh differs from the wish")
      ->type_name("FILE");
  mesh_command->add_option("--layers-out", meshing.layers_out, "Layer of each hex, beside a Medit mesh: .sol or .solb")->type_name("FILE");
  mesh_command->add_flag("--cancel-on-exit", meshing.cancel_on_exit, "Ctrl-C cancels the job on a server that goes on");
  CLI::App* submit_command = app.add_subcommand("submit", "Upload and queue; prints the job id");
  surface_and_spec(submit_command);
  naming(submit_command);
  submit_command->add_option("--format", meshing.formats, "Results to make; default: vtu,meshb")
      ->delimiter(',')
      ->check(CLI::IsMember({"vtu", "vtk", "mesh", "meshb", "sol", "solb"}));
  CLI::App* check_command = app.add_subcommand("check", "Say what is wrong with a surface and a specification, and what a run would cost");
  surface_and_spec(check_command);
  CLI::App* watch_command = job_command(app, "watch", "Follow jobs to their end", jobs);
  CLI::App* wait_command = job_command(app, "wait", "Wait in silence for jobs to end", jobs);
  wait_command->add_option("--for", wait_for, "What counts as success: succeeded, or ended, which failing and cancelling is too")
      ->check(CLI::IsMember({"succeeded", "ended"}))
      ->capture_default_str();
  CLI::App* get_command = job_command(app, "get", "Download a result; run again to continue a broken download", jobs);
  get_command->get_option("JOB")->expected(1);
  get_command->add_option("-o,--out", jobs.out, "File to write")->required()->type_name("FILE");
  get_command->add_option("--format", jobs.format, "Format, when the ending does not say it")->type_name("FORMAT");
  get_command->add_option("--report", jobs.report, "Report to write (JSON)")->type_name("FILE");
  CLI::App* list_command = app.add_subcommand("list", "List jobs, newest first");
  list_command->add_option("--state", jobs.states, "Only jobs in these states")->type_name("STATE")->delimiter(',');
  list_command->add_option("--label", jobs.labels, "Only jobs with this label, KEY=VALUE; may be repeated")->type_name("LABEL");
  CLI::App* show_command = job_command(app, "show", "Everything about jobs", jobs);
  CLI::App* cancel_command = job_command(app, "cancel", "Stop jobs", jobs);
  CLI::App* delete_command = job_command(app, "delete", "Forget jobs and their results", jobs);
  delete_command->add_flag("--force", jobs.force, "Cancel first when it runs");
  CLI::App* server_command = app.add_subcommand("server", "Ask the server");
  server_command->require_subcommand(1);
  CLI::App* status_command = server_command->add_subcommand("status", "Is it there, and what does it do");
  CLI::App* health_command = server_command->add_subcommand("health", "Does it serve; for health checks, needs no token");
  CLI::App* manual_command = app.add_subcommand("manual", "The manual page: strata manual | man -l -");
  CLI::App* version_command = app.add_subcommand("version", "Versions");
  version_command->add_flag("--of-server", of_server, "Ask the server too");
  CLI::App* completion_command = app.add_subcommand("completion", "Shell completion: source <(strata completion bash)");
  completion_command->add_option("SHELL", shell, "bash, zsh or fish")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));

  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; }))
    command->footer("strata --help lists the options of every command: --server, --output-format ...");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return error.get_exit_code() == 0 ? app.exit(error) : complain(app, error);
  }
  global.output = kOutputs.at(output);
  global.packing = kPackings.at(packing);
  jobs.any_end = wait_for == "ended";
  limit_command(global.timeout_seconds);
  const std::vector<std::pair<CLI::App*, std::function<void()>>> table{
      {mesh_command, [&] { mesh(global, meshing); }},
      {submit_command, [&] { submit(global, meshing); }},
      {check_command, [&] { check(global, meshing); }},
      {watch_command, [&] { watch_jobs(global, jobs); }},
      {wait_command, [&] { wait_for_jobs(global, jobs); }},
      {get_command, [&] { get(global, jobs); }},
      {list_command, [&] { list(global, jobs); }},
      {show_command, [&] { show(global, jobs); }},
      {cancel_command, [&] { cancel(global, jobs); }},
      {delete_command, [&] { remove(global, jobs); }},
      {status_command, [&] { server_status(global); }},
      {health_command, [&] { server_health(global); }},
      {manual_command, [&] { std::cout << manual(app); }},
      {version_command, [&] { version(global, of_server); }},
      {completion_command, [&] { std::cout << completion(app, shell); }},
  };
  try {
    for (const auto& [command, action] : table)
      if (command->parsed()) action();
  } catch (const CommandError& error) {
    print_error(error, global);
    return static_cast<int>(error.code());
  }
  return 0;
}

}  // namespace
}  // namespace strata::client

int main(int argc, char** argv) {
  mallopt(M_MMAP_THRESHOLD, strata::client::kMmapThreshold);
  mallopt(M_TRIM_THRESHOLD, strata::client::kTrimThreshold);
  strata::client::catch_signals();
  try {
    return strata::client::run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "strata: internal error: " << error.what() << '\n';
    return static_cast<int>(strata::client::ExitCode::Bug);
  }
}
