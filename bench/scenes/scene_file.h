// SceneFile: writes a scene as ClassicVRML while it is being modelled, and counts its triangles.
//
// Nothing is kept of what is written but the triangle counts of named groups, so that a file may be larger than memory
// allows. Threading: one thread. Errors of writing are kept and come from finish().
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/diagnostic.h>

#include "surface.h"

namespace rtsg::bench {

/// How something looks. `mirror` and `refraction` as in Material's metadata: a share, and a refractive index (0: none).
struct Look {
    Vec3f diffuse{.8f};
    float specular = 0, shininess = .2f, mirror = 0, refraction = 0, transparency = 0;
    Vec3f emissive{0};
    std::string texture = {};  // url
    Vec2f repeats{1};          // of the texture, per unit of texture coordinates
};

struct Placement {
    Vec3f translation{0};
    Rotation rotation{0, 1, 0, 0};
    Vec3f scale{1};
};

class SceneFile {
  public:
    explicit SceneFile(const std::filesystem::path& file);

    /// ClassicVRML as it is.
    template <class... T>
    void raw(fmt::format_string<T...> format, T&&... values) {
        fmt::format_to(std::back_inserter(buffer_), format, std::forward<T>(values)...);
        flushIfLong();
    }
    /// Defines an Appearance for later use by name; between groups only.
    void look(std::string_view name, const Look& look);

    /// A Transform; `def` may be empty.
    void open(const Placement& placement, std::string_view def = {});
    void close();
    /// The group defined under that name once more.
    void use(std::string_view def);
    void useAt(const Placement& placement, std::string_view def);

    enum class Shading { smooth, flat };
    /// `def`: names the geometry.
    void shape(const Surface& surface, std::string_view look, Shading shading = Shading::flat,
               std::string_view def = {});
    void shapeOf(std::string_view geometry, std::string_view look);
    /// For triangles in raw text, per path.
    void count(std::uint64_t triangles) { groups_.back().triangles += triangles; }
    std::uint64_t counted() const { return groups_.back().triangles; }
    /// Forgets the triangles counted so far, which only serve as a template and are not shown.
    void resetCount() { groups_.back().triangles = 0; }

    /// Writes what shape() writes, without the Shape: "DEF X IndexedTriangleSet {...}".
    void geometry(const Surface& surface, Shading shading, std::string_view def = {}, bool texCoords = false);
    void points(const std::vector<Vec3f>& points);

    /// Triangles along all paths. Error: the file could not be written.
    Result<std::uint64_t> finish();

  private:
    struct Group {
        std::string def;
        std::uint64_t triangles = 0;
    };
    void number(float value);
    void integer(std::int32_t value);
    void transformHead(const Placement& placement);
    void flushIfLong() {
        if (buffer_.size() > (1u << 20)) flush();
    }
    void flush();

    std::filesystem::path path_;
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    std::unique_ptr<std::FILE, Close> file_;
    std::string buffer_;
    std::vector<Group> groups_{1};
    std::unordered_map<std::string, std::uint64_t> named_;
    std::unordered_set<std::string> textured_;  // looks that need texture coordinates
    bool failed_ = false;
};

}  // namespace rtsg::bench
