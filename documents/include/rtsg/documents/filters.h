// The filters of documents that have a name, as `rtsg convert --filter` takes them.
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
    std::string_view argument;  // what stands for it in help; empty: it takes none
    std::string_view what;
};
std::span<const FilterInfo> filters();

struct FilterContext {
    Diagnostics& diagnostics;                  // what filters report; must outlive them
    std::optional<Resources> resources{};      // what they may open; none given: Resources::ofFile(file)
    std::filesystem::path file{};              // of the document, where relative urls start
    const ScriptLanguage* scripts = nullptr;   // by which "validate" checks the texts of Scripts; null: not at all
    std::shared_ptr<const Dialect> dialect{};  // of the document; null: none
};

/// By its name, with its argument behind an equals sign: "quantise=1e-3". Filters that look at a document as a whole
/// keep it in memory, and pass it on when it ends. Errors: there is none of that name, or its argument is wrong.
Result<std::unique_ptr<DocumentHandler>> makeFilter(std::string_view name, DocumentHandler& next,
                                                    const FilterContext& context);

}  // namespace rtsg
