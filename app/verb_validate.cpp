// rtsg validate: errors and warnings of files, with positions.
#include <memory>

#include <fmt/format.h>

#include <rtsg/core/resource_check.h>

#include "cli.h"

namespace rtsg::app {

Verb addValidate(Command& program) {
    struct Options {
        std::vector<std::string> files;
        ResourceArguments resources;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    Command* command = program.addVerb("validate", "Print errors and warnings with positions; look for what urls name");
    command->addOption("FILE", options->files, "scene files")->required();
    options->resources.addTo(*command);
    command->addFlag("--json", options->json, "one JSON object a file");
    command->footer("Example: rtsg validate models/*.x3d\nExit status 1 if any file has an error.");
    return {command, [options] {
                bool good = true;
                for (const std::string& file : options->files) {
                    Scene scene;
                    Diagnostics diagnostics(file);
                    const Resources resources = options->resources.ofFile(file);
                    const bool ok = load(scene, file, diagnostics, resources) && diagnostics.errors() == 0;
                    Diagnostics missing(file);
                    checkResources(scene, resources, missing);
                    print(missing);
                    diagnostics.append(missing);
                    good = good && ok;
                    if (options->json)
                        fmt::print("{{\"file\":{},\"errors\":{},\"warnings\":{}}}\n", jsonString(file),
                                   diagnostics.errors(), diagnostics.warnings());
                    else
                        fmt::print("{}: {} errors, {} warnings\n", file, diagnostics.errors(), diagnostics.warnings());
                }
                return good ? kDone : kBad;
            }};
}

}  // namespace rtsg::app
