// rtsg convert: converts a document from one encoding to another, through filters and without a scene. Only .rtsgb and
// other programs' meshes need a scene.
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <ranges>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/web_address.h>
#include <rtsg/documents/filters.h>
#include <rtsg/documents/resource_check.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/mesh_file.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/session/triangulate.h>
#include <rtsg/sync/scene_file.h>

#include "cli.h"
#include "extensions.h"
#include "files.h"
#include "start_time.h"

namespace rtsg::app {

namespace {

constexpr std::string_view kTriangulate = "triangulate";  // belongs to the renderers, which know geometry

struct ConvertArguments {
    std::string in, out, encoding, clip;
    std::vector<std::string> filters;
    ResourceArguments resources;
    unsigned threads = 0;
    bool force = false, keepMeshes = false;
};

bool isBinaryName(const std::string& file) {
    return std::filesystem::path(file).extension() == ".rtsgb";
}

/// The encoding for standard output, whose name says nothing.
Encoding encodingOf(const ConvertArguments& options) {
    Encoding encoding = Encoding::classicVrml;
    bool gzip = false;
    if (!options.encoding.empty()) encodingFromName("out." + options.encoding, encoding, gzip);
    return encoding;
}

/// Puts the named filters before `last`; `chain` owns them.
DocumentHandler* filtered(const ConvertArguments& options, const Resources& resources, DocumentHandler& last,
                          Diagnostics& diagnostics, std::vector<std::unique_ptr<DocumentHandler>>& chain) {
    const std::string file = options.in == "-" ? "" : options.in;
    const FilterContext context{diagnostics, resources, file, ecmaScript().get(), extensions().dialect()};
    DocumentHandler* first = &last;
    for (const std::string& name : options.filters | std::views::reverse) {
        if (name.starts_with(std::string(kTriangulate) + '='))
            throw UsageError("--filter", fmt::format("filter {} takes no argument", kTriangulate));
        auto created = name == kTriangulate ? makeTriangulate(*first, diagnostics) : makeFilter(name, *first, context);
        if (!created) throw UsageError("--filter", created.error().text);
        first = chain.emplace_back(std::move(*created)).get();
    }
    return first;
}

/// Throws for an unknown filter, before anything is written.
void checkFilters(const ConvertArguments& options) {
    Filter nowhere;
    Diagnostics unheard;
    std::vector<std::unique_ptr<DocumentHandler>> chain;
    (void)filtered(options, Resources(), nowhere, unheard, chain);
}

/// Converts the state of a scene rather than the text of a document.
int convertBinary(const ConvertArguments& options, const Resources& resources) {
    Diagnostics diagnostics(options.in);
    Scene scene;
    runScripts(scene);
    extensions().registerWith(scene);
    std::vector<std::unique_ptr<DocumentHandler>> chain;
    bool ok = true;
    if (isSceneFile(options.in)) {
        if (!options.clip.empty())
            diagnostics.error({}, "it has no clip " + options.clip + ": only glTF files have clips");
        if (const auto read = readSceneFile(scene, options.in); !read)
            return printError(fmt::format("{}: {}", options.in, read.error().format())), kBad;
    } else {
        BuildOptions build;
        build.resources = resources;
        if (options.in != "-") build.file = options.in;
        SceneBuilder builder(scene, diagnostics, build);
        const Progress bar = progressBar("reading " + options.in);
        ok = readDocumentFile(options.in, *filtered(options, resources, builder, diagnostics, chain), diagnostics,
                              {.progress = bar,
                               .threads = options.threads,
                               .clip = options.clip,
                               .dialect = extensions().dialect(),
                               .resources = &resources});
        builder.finish();
        if (bar) bar(1, 1);
        scene.newFrame(0);
    }
    if (!ok) {
        print(diagnostics);
        printError(fmt::format("reading {} stopped early: {} was not written", options.in, options.out));
        return kBad;
    }
    keepResources(scene, resources, {{"OUT", options.out, OutputKind::scene}});
    Result<> written;
    if (MeshFormat format{}; meshFormatFromName(options.out, format)) {
        Diagnostics meshes(options.in);
        Flattener flattener;
        extensions().registerWith(flattener, scene);
        const auto content =
            writeMeshFile(scene, options.out, format, meshes, existing(options.force), resources, std::move(flattener));
        diagnostics.append(meshes);
        if (!content) written = std::unexpected(content.error());
    } else if (isBinaryName(options.out)) {
        written = writeSceneFile(scene, options.out, existing(options.force));
    } else {
        auto writer = DocumentFileWriter::create(options.out, diagnostics, existing(options.force), encodingOf(options),
                                                 dialectOf(scene));
        if (!writer) return printError(writer.error()), kBad;
        DocumentHandler* first = &(*writer)->handler();
        if (isSceneFile(options.in)) first = filtered(options, resources, *first, diagnostics, chain);
        SceneExporter(scene, diagnostics).write(*first);
        written = (*writer)->close();
    }
    print(diagnostics);
    if (!written) return printError(written.error()), kBad;
    return diagnostics.errors() == 0 ? kDone : kBad;
}

int convert(ConvertArguments options) {
    checkFilters(options);
    if (!options.encoding.empty() && options.out != "-")
        throw UsageError("--encoding", fmt::format("is of -, standard output: the name {} says its own", options.out));
    if (auto ok = checkFiles({options.in}, {{"OUT", options.out, OutputKind::scene}}, options.force); !ok)
        return printError(ok.error()), kBad;
    const Resources resources = options.resources.ofFile(options.in);
    MeshFormat mesh{};
    if (options.keepMeshes && !isRobotFile(options.in))
        throw UsageError("--keep-meshes", options.in + " is no robot, so its meshes stay where they are");
    if (isBinaryName(options.out) || meshFormatFromName(options.out, mesh) ||
        (options.in != "-" && !isWebAddress(options.in) && isSceneFile(options.in)))
        return convertBinary(options, resources);
    Diagnostics diagnostics(options.in);
    if (!options.keepMeshes && isRobotFile(options.in)) options.filters.insert(options.filters.begin(), "embed");
    (void)interrupted();  // from here on an interruption ends the program in order and leaves no partial file
    auto writer = DocumentFileWriter::create(options.out, diagnostics, existing(options.force), encodingOf(options),
                                             extensions().dialect());
    if (!writer) return printError(writer.error()), kBad;
    const Progress bar = progressBar("converting " + options.in);
    const Progress progress = [&](std::uint64_t done, std::uint64_t total) {
        if (bar) bar(done, total);
        if (!interrupted()) return;
        // The readers cannot be stopped from here. Without close() there is no file.
        writer->reset();
        printError("interrupted: " + options.out + " was not written");
        std::exit(kBad);
    };
    std::vector<std::unique_ptr<DocumentHandler>> chain;
    DocumentHandler* first = filtered(options, resources, (*writer)->handler(), diagnostics, chain);
    // The copy must not replace a file that the document loads.
    std::optional<DocumentFiles> used;
    if (std::filesystem::exists(options.out)) first = &used.emplace(*first, resources);
    const bool ok = readDocumentFile(options.in, *first, diagnostics,
                                     {.progress = progress,
                                      .threads = options.threads,
                                      .clip = options.clip,
                                      .dialect = extensions().dialect(),
                                      .resources = &resources});
    if (bar) bar(1, 1);
    print(diagnostics);
    if (used) keepFiles(used->files(), {{"OUT", options.out, OutputKind::scene}});
    if (!ok) {
        printError(fmt::format("reading {} stopped early: {} was not written", options.in, options.out));
        return kBad;
    }
    if (const auto closed = (*writer)->close(); !closed) return printError(closed.error()), kBad;
    if (diagnostics.errors() == 0) return kDone;
    printError(fmt::format("{} holds what could be read; {} errors", options.out, diagnostics.errors()));
    return kBad;
}

}  // namespace

Verb addConvert(Command& program) {
    auto options = std::make_shared<ConvertArguments>();
    Command* command = program.addVerb("convert", "Convert between encodings, streaming, without building a scene");
    command
        ->addOption("IN", options->in,
                    "scene file (X3D, VRML97, JSON, .rtsgb, glTF, STL, OBJ, PLY, URDF, Collada), or -")
        ->required();
    command
        ->addOption("OUT", options->out,
                    "file to write (.x3d .x3dv .wrl .json, also .gz; .rtsgb; .stl .obj .ply .glb), or -")
        ->required();
    command
        ->addOption("--encoding", options->encoding,
                    "for OUT -, by file extension: x3d (XML), x3dv (ClassicVRML, the default), wrl (VRML97), json")
        ->oneOf({"x3d", "x3dv", "wrl", "json"});
    command->addOption("--filter", options->filters, "NAME or NAME=ARGUMENT, applied in this order; listed below");
    command->addFlag("--keep-meshes", options->keepMeshes,
                     "of a robot (URDF): name the files of its meshes; else the filter embed is on");
    addClip(*command, options->clip);
    options->resources.addTo(*command);
    command->addOption("--threads", options->threads,
                       "threads that read a list of numbers of more than 4 MiB (0: one a core; at most 8)");
    std::string list = "Filters:\n";
    const auto line = [&](std::string_view name, std::string_view argument, std::string_view what) {
        list += fmt::format("  {:<30} {}\n", fmt::format("{}{}{}", name, argument.empty() ? "" : "=", argument), what);
    };
    for (const FilterInfo& one : filters()) {
        if (one.name > kTriangulate && !list.contains(kTriangulate))
            line(kTriangulate, "", "geometry becomes triangles with indices");
        line(one.name, one.argument, one.what);
    }
    command->footer(list +
                    "Example: rtsg convert hall.wrl hall.x3d --filter drop-metadata --filter quantise=1e-4\n"
                    "Example: rtsg convert hall.x3dv - --encoding json");
    addForce(*command, options->force);
    return {command, [options] { return convert(*options); }};
}

}  // namespace rtsg::app
