#include <memory>

#include <fmt/format.h>

#include <rtsg/core/writer.h>

#include "cli.h"

namespace rtsg::app {

Verb addConvert(CLI::App& program) {
    struct Options {
        std::string in, out;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command =
        program.add_subcommand("convert", "Convert between encodings, streaming, without building a scene");
    command->add_option("IN", options->in, "scene file, or -")->required();
    command->add_option("OUT", options->out, "file to write (.x3d .x3dv .wrl, also .gz), or -")->required();
    command->footer("Example: rtsg convert hall.wrl hall.x3d");
    return {command, [options] {
                Diagnostics diagnostics(options->in);
                auto writer = DocumentFileWriter::create(options->out, diagnostics);
                if (!writer) return printError(writer.error().text), static_cast<int>(kBad);
                const Progress progress = progressBar("converting " + options->in);
                const bool ok = readDocumentFile(options->in, (*writer)->handler(), diagnostics, progress);
                const auto closed = (*writer)->close();
                print(diagnostics);
                if (!closed) printError(closed.error().text);
                return static_cast<int>(ok && closed && diagnostics.errors() == 0 ? kDone : kBad);
            }};
}

}  // namespace rtsg::app
