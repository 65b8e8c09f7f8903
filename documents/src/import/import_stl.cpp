// STL, text and binary: one shape, whose corners at equal places become one point.
#include <bit>
#include <cstring>
#include <unordered_map>

#include "import.h"
#include "text/utf8.h"

namespace rtsg::detail {

namespace {

/// Gives equal points one number.
class PointIndex {
  public:
    explicit PointIndex(ImportedMesh& mesh) : mesh_(mesh) {}
    void add(const Vec3f& point) {
        const auto [found, isNew] = numbers_.try_emplace(
            Key{std::bit_cast<std::uint32_t>(point.x + 0.0f), std::bit_cast<std::uint32_t>(point.y + 0.0f),
                std::bit_cast<std::uint32_t>(point.z + 0.0f)},
            static_cast<std::int32_t>(mesh_.points.size()));
        if (isNew) mesh_.points.push_back({point.x + 0.0f, point.y + 0.0f, point.z + 0.0f});  // no negative zeros
        mesh_.faces.push_back(found->second);
    }

  private:
    struct Key {
        std::uint32_t x, y, z;
        bool operator==(const Key&) const = default;
    };
    struct Hash {
        std::size_t operator()(const Key& k) const {
            std::uint64_t h = (std::uint64_t{k.x} << 32 | k.y) * 0x9E3779B97F4A7C15u;
            h = (h ^ (h >> 29) ^ k.z) * 0xBF58476D1CE4E5B9u;
            return h ^ (h >> 32);
        }
    };
    ImportedMesh& mesh_;
    std::unordered_map<Key, std::int32_t, Hash> numbers_;
};

void readBinary(std::string_view bytes, PointIndex& points) {
    constexpr std::size_t head = 84, facet = 50, normal = 12;
    for (std::size_t at = head; at + facet <= bytes.size(); at += facet) {
        float numbers[9];
        std::memcpy(numbers, bytes.data() + at + normal, sizeof(numbers));
        for (int corner = 0; corner < 3; ++corner)
            points.add({numbers[3 * corner], numbers[3 * corner + 1], numbers[3 * corner + 2]});
    }
}

/// Reads a text STL; a facet has three corners.
void readText(std::string_view text, PointIndex& points, std::string& name, Diagnostics& diagnostics) {
    LineScanner lines(text);
    Vec3f corners[3];
    std::size_t count = 0;
    while (lines.nextLine()) {
        const std::string_view word = lines.word();
        if (word == "solid" && name.empty()) {
            name = lines.rest();
        } else if (word == "vertex") {
            Vec3f point;
            if (!lines.number(point.x) || !lines.number(point.y) || !lines.number(point.z)) {
                diagnostics.error({lines.line(), 1}, "expected three numbers behind vertex; the facet is left out");
                count = 4;
            } else if (count < 3) {
                corners[count++] = point;
            } else if (count == 3) {
                diagnostics.error({lines.line(), 1}, "a facet has three corners; this one is left out");
            }
        } else if (word == "endloop" || word == "endfacet") {
            if (count == 3)
                for (const Vec3f& corner : corners) points.add(corner);
            else if (count == 1 || count == 2)
                diagnostics.error({lines.line(), 1}, "a facet has three corners; it is left out");
            count = 0;
        }
    }
}

}  // namespace

bool importStl(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    ImportedMesh mesh;
    PointIndex points(mesh);
    std::string name;
    std::uint32_t facets = 0;
    if (input.bytes.size() >= 84) std::memcpy(&facets, input.bytes.data() + 80, sizeof(facets));
    // Some programs begin binary files with "solid": the size decides.
    if (facets > 0 && input.bytes.size() == 84 + 50 * std::uint64_t{facets})
        readBinary(input.bytes, points);
    else
        readText(input.bytes, points, name, diagnostics);
    if (mesh.faces.empty()) {
        diagnostics.error({}, "the STL file has no facets");
        return false;
    }
    mesh.triangles = true;
    mesh.smooth = false;  // facets of an STL file are flat
    beginImported(handler, "from STL");
    std::size_t replaced = 0;  // the format knows no encoding
    if (!name.empty()) handler.meta("title", replaceInvalidUtf8(name, replaced), {});
    handler.beginNode("Shape", {}, {}, {});
    writeAppearance(handler, "Material");
    writeMesh(handler, std::move(mesh));
    handler.endNode({});
    handler.endDocument();
    return true;
}

}  // namespace rtsg::detail
