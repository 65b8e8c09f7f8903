// Checks whether the files that a scene names by url can be opened: pictures, sounds, scripts, shaders, documents.
//
// Opens each file as a player of the scene would, and reads none. One url of a list is enough. A missing file is a
// warning, as it is when the scene is played. Inlines that a loader was asked to load have been reported by the loader.
// Threading: the scene's thread.
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

/// Notes where a document names files. This filter stands before the builder of the scene.
class UrlPlaces final : public Filter {
  public:
    using Filter::Filter;
    void setField(std::string_view name, Value value, SourceLocation where) override;
    /// The next of the places where the field was given these urls; the last one again when there are no more, since a
    /// prototype's body stands for all its instances. No place if the document has none.
    SourceLocation next(std::string_view field, const Array<String>& urls);

  private:
    std::map<std::string, std::deque<SourceLocation>, std::less<>> places_;
};

/// `places`: of the document that the scene was made of, for complaints with positions.
void checkResources(const Scene& scene, const Resources& resources, Diagnostics& diagnostics,
                    UrlPlaces* places = nullptr);

/// The files that urls of the scene open: what must not be written while the scene is played. Each url that names a
/// file that is there counts, not just the first of a list.
std::vector<std::filesystem::path> resourceFiles(const Scene& scene, const Resources& resources);

/// The same of a document that makes no scene, as it goes by; not of the documents that it loads.
class DocumentFiles final : public Filter {
  public:
    DocumentFiles(DocumentHandler& next, Resources resources) : Filter(next), resources_(resources.withoutNetwork()) {}
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
