// The named filters of documents, which `rtsg convert --filter` offers.
//
// Threading: one thread a stream. Source: RTSG paper 3.1.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include <rtsg/core/resource.h>
#include <rtsg/documents/dialect.h>
#include <rtsg/documents/filter.h>

namespace rtsg {

class ScriptLanguage;

/// A filter of `rtsg convert --filter NAME`, or NAME=ARGUMENT.
struct FilterInfo {
    std::string_view name;
    std::string_view argument;  // placeholder in the help text; empty: the filter has no argument
    std::string_view what;
};
std::span<const FilterInfo> filters();

struct FilterContext {
    Diagnostics& diagnostics;                  // receives the filters' reports; must outlive them
    std::optional<Resources> resources{};      // what filters may open; the default is Resources::ofFile(file)
    std::filesystem::path file{};              // of the document; relative urls start beside it
    const ScriptLanguage* scripts = nullptr;   // checks the programs of Scripts for "validate"; null: no check
    std::shared_ptr<const Dialect> dialect{};  // that of the document; null: none
};

/// Makes a filter by its name, with its argument behind an equals sign: "quantise=1e-3". Filters that need the whole
/// document keep it in memory, and pass it on when it ends. Errors: there is none of that name; its argument is wrong.
Result<std::unique_ptr<DocumentHandler>> makeFilter(std::string_view name, DocumentHandler& next,
                                                    const FilterContext& context);

/// Whether the file describes a robot (URDF), whose meshes "embed" puts into what other browsers read. It looks at the
/// file's first bytes; of an address, and of "-", at the name.
bool isRobotFile(const std::filesystem::path& file);

}  // namespace rtsg
