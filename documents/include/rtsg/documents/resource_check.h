// Checks whether the files that a scene names by url can be opened: pictures, sounds, scripts, shaders, documents.
//
// It opens each file in the same way as a player of the scene would, and reads none. One working url of a list is
// enough. A missing file is a warning, as it is when the scene is played. Inlines are not checked if the loader was to
// load them, since it has reported them. Threading: the scene's thread.
#pragma once

#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/filter.h>

namespace rtsg {

/// Records the positions at which a document names files. Put this filter before the builder of the scene.
class UrlLocations final : public Filter {
  public:
    using Filter::Filter;
    void setField(std::string_view name, Value value, SourceLocation where) override;
    /// The next position at which the field was given these urls; the last one again if there are no more, since a
    /// prototype's body serves all its instances. No position if the document has none.
    SourceLocation next(std::string_view field, const Array<String>& urls);

  private:
    std::map<std::string, std::deque<SourceLocation>, std::less<>> locations_;
};

/// `places` are those of the document of the scene, for diagnostics with positions.
void checkResources(const Scene& scene, const Resources& resources, Diagnostics& diagnostics,
                    UrlLocations* locations = nullptr);

/// The files that urls of the scene open, which must not be overwritten while the scene is played. Each url that names
/// an existing file counts, not just the first of a list.
std::vector<std::filesystem::path> resourceFiles(const Scene& scene, const Resources& resources);

/// The same for a document that passes by without a scene; files of documents that it loads are not included.
class DocumentFiles final : public Filter {
  public:
    DocumentFiles(DocumentHandler& next, const Resources& resources)
        : Filter(next), resources_(resources.withoutNetwork()) {}
    void setField(std::string_view name, Value value, SourceLocation where) override;
    void declareField(const FieldDeclaration& field, std::optional<Value> value, SourceLocation where) override;
    void externProto(std::string_view name, const std::vector<FieldDeclaration>& fields,
                     const std::vector<std::string>& url, SourceLocation where) override;
    const std::vector<std::filesystem::path>& files() const { return files_; }

  private:
    void note(std::string_view field, const Value& value);
    void note(std::string_view url);

    const Resources resources_;
    std::vector<std::filesystem::path> files_;
};

}  // namespace rtsg
