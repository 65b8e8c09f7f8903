// rtsg convert: a document from one encoding to another, through filters, without a scene.
#include <cstdlib>
#include <memory>
#include <ranges>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/filter.h>
#include <rtsg/core/writer.h>

#include "cli.h"
#include "files.h"

namespace rtsg::app {

namespace {

struct Options {
    std::string in, out;
    std::vector<std::string> filters;
    bool force = false;
};

int convert(const Options& options) {
    if (auto ok = checkFiles({options.in}, {{"OUT", options.out, OutputKind::scene}}, options.force); !ok)
        return printError(ok.error()), kBad;
    Diagnostics diagnostics(options.in);
    (void)interrupted();  // from here on an interruption ends in order: no half file stays
    auto writer = DocumentFileWriter::create(options.out, diagnostics, existing(options.force));
    if (!writer) return printError(writer.error()), kBad;
    const Progress bar = progressBar("converting " + options.in);
    const Progress progress = [&](std::uint64_t done, std::uint64_t total) {
        if (bar) bar(done, total);
        if (!interrupted()) return;
        // The readers cannot be stopped from here; without close() there is no file.
        writer->reset();
        printError("interrupted: " + options.out + " was not written");
        std::exit(kBad);
    };
    std::vector<std::unique_ptr<DocumentHandler>> filters;  // the last one first
    DocumentHandler* first = &(*writer)->handler();
    for (const std::string& name : options.filters | std::views::reverse)
        first = filters.emplace_back(makeFilter(name, *first)).get();
    const bool ok = readDocumentFile(options.in, *first, diagnostics, progress);
    if (bar) bar(1, 1);
    print(diagnostics);
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
    auto options = std::make_shared<Options>();
    Command* command = program.addVerb("convert", "Convert between encodings, streaming, without building a scene");
    command->addOption("IN", options->in, "scene file, or -")->required();
    command->addOption("OUT", options->out, "file to write (.x3d .x3dv .wrl .json, also .gz), or -")->required();
    std::vector<std::string> known;
    for (const std::string_view name : filterNames()) known.emplace_back(name);
    command->addOption("--filter", options->filters, "applied in this order")->oneOf(known);
    command->footer("Example: rtsg convert hall.wrl hall.x3d --filter drop-metadata");
    addForce(*command, options->force);
    return {command, [options] { return convert(*options); }};
}

}  // namespace rtsg::app
