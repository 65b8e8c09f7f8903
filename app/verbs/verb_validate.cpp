// rtsg validate: reports errors and warnings of files, with positions.
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/documents/filters.h>
#include <rtsg/documents/language_server.h>
#include <rtsg/documents/resource_check.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/scene_file.h>

#include "cli.h"
#include "extensions.h"

namespace rtsg::app {

namespace {

const char* levelOf(Severity severity) {
    return severity == Severity::error ? "error" : severity == Severity::warning ? "warning" : "note";
}

std::string findingsAsJson(const Diagnostics& diagnostics) {
    std::string result;
    for (const Diagnostic& d : diagnostics.all())
        result += fmt::format("{}{{\"severity\":\"{}\",\"file\":{},\"line\":{},\"column\":{},\"code\":{},\"text\":{}}}",
                              result.empty() ? "" : ",", levelOf(d.severity), jsonString(d.file), d.where.line,
                              d.where.column, jsonString(std::string(d.code.text())), jsonString(d.text));
    return result;
}

/// Source: OASIS, Static Analysis Results Interchange Format 2.1.0.
std::string asSarif(const std::vector<Diagnostics>& files) {
    std::string results, rules;
    std::set<std::string> known;
    for (const Diagnostics& diagnostics : files)
        for (const Diagnostic& d : diagnostics.all()) {
            const std::string code = jsonString(std::string(d.code.text()));
            if (known.insert(code).second) rules += fmt::format("{}{{\"id\":{}}}", rules.empty() ? "" : ",", code);
            std::string region;
            if (d.where.line > 0)
                region = fmt::format(",\"region\":{{\"startLine\":{}{}}}", d.where.line,
                                     d.where.column ? fmt::format(",\"startColumn\":{}", d.where.column) : "");
            const std::string& file = d.file.empty() ? diagnostics.file() : d.file;
            results += fmt::format(
                "{}{{\"ruleId\":{},\"level\":\"{}\",\"message\":{{\"text\":{}}},\"locations\":[{{\"physicalLocation\":"
                "{{\"artifactLocation\":{{\"uri\":{}}}{}}}}}]}}",
                results.empty() ? "" : ",", code, levelOf(d.severity), jsonString(d.text), jsonString(file), region);
        }
    return fmt::format(
        "{{\"$schema\":\"https://json.schemastore.org/sarif-2.1.0.json\",\"version\":\"2.1.0\",\"runs\":[{{\"tool\":"
        "{{\"driver\":{{\"name\":\"rtsg\",\"rules\":[{}]}}}},\"results\":[{}]}}]}}",
        rules, results);
}

/// Does what load() does, and checks the document as a whole. Files that Inlines load are not checked here.
bool loadAndCheck(Scene& scene, const std::string& file, Diagnostics& diagnostics, const Resources& resources) {
    bool usable = false;
    Diagnostics missing(diagnostics.file());
    if (file != "-" && isSceneFile(file)) {
        usable = load(scene, file, diagnostics, resources);
        checkResources(scene, resources, missing);
    } else {
        if (file == "-") diagnostics.setFile("<stdin>");
        BuildOptions options;
        options.resources = resources;
        if (file != "-") options.file = file;
        extensions().registerWith(scene);
        SceneBuilder builder(scene, diagnostics, options);
        UrlLocations locations(builder);
        const auto check = makeFilter("validate", locations,
                                      {diagnostics, resources, file, ecmaScript().get(), extensions().dialect()});
        const bool complete = check && readDocumentFile(file, **check, diagnostics,
                                                        {.dialect = extensions().dialect(), .resources = &resources});
        builder.finish();
        print(diagnostics);
        usable = complete || !builder.roots().empty();
        missing.setFile(diagnostics.file());
        checkResources(scene, resources, missing, &locations);
    }
    print(missing);
    diagnostics.append(missing);
    return usable;
}

ExitStatus serveAnEditor(const std::vector<std::string>& files, const ResourceArguments& resources) {
    if (!files.empty()) throw UsageError("--lsp", "the editor names the files");
    LanguageServerOptions options;
    options.policy = resources.ofReplica().policy();
    const auto scripts = ecmaScript();
    options.scripts = scripts.get();
    const auto served = serveEditor(STDIN_FILENO, STDOUT_FILENO, options);
    if (!served) return printError(served.error()), kBad;
    return kDone;
}

}  // namespace

Verb addValidate(Command& program) {
    struct ValidateArguments {
        std::vector<std::string> files;
        ResourceArguments resources;
        bool json = false, sarif = false, lsp = false;
    };
    auto options = std::make_shared<ValidateArguments>();
    Command* command =
        program.addVerb("validate", "Print errors and warnings with positions; check that files behind urls exist");
    command->addOption("FILE", options->files, "scene files");
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "one JSON object for each file, with all its problems");
    command->addFlag("--sarif", options->sarif, "all files as one SARIF 2.1.0 log, for editors and CI");
    command->addFlag("--lsp", options->lsp,
                     "serve an editor over standard input and output, by the Language Server Protocol");
    command->footer("Example: rtsg validate models/*.x3d\nExit status 1 if any file has an error.");
    return {command, [options] {
                if (options->lsp) return serveAnEditor(options->files, options->resources);
                if (options->files.empty()) throw UsageError("FILE is required, or --lsp");
                bool good = true;
                std::vector<Diagnostics> all;
                for (const std::string& file : options->files) {
                    Scene scene;
                    Diagnostics diagnostics(file);
                    const Resources resources = options->resources.ofFile(file);
                    const bool ok = loadAndCheck(scene, file, diagnostics, resources) && diagnostics.errors() == 0;
                    good = good && ok;
                    if (options->sarif)
                        all.push_back(std::move(diagnostics));
                    else if (options->json)
                        fmt::print("{{\"file\":{},\"errors\":{},\"warnings\":{},\"diagnostics\":[{}]}}\n",
                                   jsonString(file), diagnostics.errors(), diagnostics.warnings(),
                                   findingsAsJson(diagnostics));
                    else
                        fmt::print("{}: {} errors, {} warnings\n", file, diagnostics.errors(), diagnostics.warnings());
                }
                if (options->sarif) fmt::print("{}\n", asSarif(all));
                return good ? kDone : kBad;
            }};
}

}  // namespace rtsg::app
