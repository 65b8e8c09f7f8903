#include <memory>
#include <ranges>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/filter.h>
#include <rtsg/core/writer.h>

#include "cli.h"

namespace rtsg::app {

Verb addConvert(CLI::App& program) {
    struct Options {
        std::string in, out;
        std::vector<std::string> filters;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command =
        program.add_subcommand("convert", "Convert between encodings, streaming, without building a scene");
    command->add_option("IN", options->in, "scene file, or -")->required();
    command->add_option("OUT", options->out, "file to write (.x3d .x3dv .wrl .json, also .gz), or -")->required();
    std::vector<std::string> known;
    for (const std::string_view name : filterNames()) known.emplace_back(name);
    command->add_option("--filter", options->filters, "applied in this order")->check(CLI::IsMember(known));
    command->footer("Example: rtsg convert hall.wrl hall.x3d --filter drop-metadata");
    return {command, [options] {
                Diagnostics diagnostics(options->in);
                auto writer = DocumentFileWriter::create(options->out, diagnostics);
                if (!writer) return printError(writer.error().text), static_cast<int>(kBad);
                const Progress progress = progressBar("converting " + options->in);
                std::vector<std::unique_ptr<DocumentHandler>> filters;  // the last one first
                DocumentHandler* first = &(*writer)->handler();
                for (const std::string& name : options->filters | std::views::reverse)
                    first = filters.emplace_back(makeFilter(name, *first)).get();
                const bool ok = readDocumentFile(options->in, *first, diagnostics, progress);
                const auto closed = (*writer)->close();
                print(diagnostics);
                if (!closed) printError(closed.error().text);
                return static_cast<int>(ok && closed && diagnostics.errors() == 0 ? kDone : kBad);
            }};
}

}  // namespace rtsg::app
