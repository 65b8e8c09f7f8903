// PLY, text and binary of either byte order: vertices with normals, colours and texture coordinates, and faces.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <optional>
#include <vector>

#include "import.h"

namespace rtsg::detail {

namespace {

enum class Number : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::array<std::uint8_t, 8> kSizes = {1, 1, 2, 2, 4, 4, 4, 8};

std::optional<Number> numberType(std::string_view name) {
    struct Row {
        std::string_view name;
        Number number;
    };
    constexpr auto rows = std::to_array<Row>({{"char", Number::i8},
                                              {"int8", Number::i8},
                                              {"uchar", Number::u8},
                                              {"uint8", Number::u8},
                                              {"short", Number::i16},
                                              {"int16", Number::i16},
                                              {"ushort", Number::u16},
                                              {"uint16", Number::u16},
                                              {"int", Number::i32},
                                              {"int32", Number::i32},
                                              {"uint", Number::u32},
                                              {"uint32", Number::u32},
                                              {"float", Number::f32},
                                              {"float32", Number::f32},
                                              {"double", Number::f64},
                                              {"float64", Number::f64}});
    const auto* found = std::ranges::find(rows, name, &Row::name);
    return found == rows.end() ? std::nullopt : std::optional(found->number);
}

/// The meaning of a vertex's property; `indices` is a face's list of vertices.
enum class Meaning : std::uint8_t { none, x, y, z, nx, ny, nz, s, t, red, green, blue, alpha, indices };

Meaning meaningOf(std::string_view name) {
    struct Row {
        std::string_view name;
        Meaning meaning;
    };
    constexpr auto rows = std::to_array<Row>({{"x", Meaning::x},
                                              {"y", Meaning::y},
                                              {"z", Meaning::z},
                                              {"nx", Meaning::nx},
                                              {"ny", Meaning::ny},
                                              {"nz", Meaning::nz},
                                              {"s", Meaning::s},
                                              {"u", Meaning::s},
                                              {"texture_u", Meaning::s},
                                              {"t", Meaning::t},
                                              {"v", Meaning::t},
                                              {"texture_v", Meaning::t},
                                              {"red", Meaning::red},
                                              {"green", Meaning::green},
                                              {"blue", Meaning::blue},
                                              {"alpha", Meaning::alpha},
                                              {"vertex_indices", Meaning::indices},
                                              {"vertex_index", Meaning::indices}});
    const auto* found = std::ranges::find(rows, name, &Row::name);
    return found == rows.end() ? Meaning::none : found->meaning;
}

struct Property {
    Number number{};
    std::optional<Number> count{};  // of a list
    Meaning meaning = Meaning::none;
};
struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<Property> properties;
};

class PlyReader {
  public:
    PlyReader(std::string_view bytes, Diagnostics& diagnostics)
        : bytes_(bytes), lines_(bytes), diagnostics_(diagnostics) {}

    bool read() {
        if (!readHeader()) return false;
        for (const Element& element : elements_) {
            const bool vertices = element.name == "vertex", faces = element.name == "face";
            if (element.properties.empty() && !text_) continue;  // of no bytes, however many there are
            // Nothing is reserved for a count: the file may be shorter than it says.
            for (std::uint64_t i = 0; i < element.count; ++i) {
                if (text_ && !nextDataLine()) return ended(element);
                values_.fill(0);
                for (const Property& property : element.properties)
                    if (!readProperty(property, faces)) return ended(element);
                if (vertices) addVertex();
            }
        }
        return true;
    }
    ImportedMesh& mesh() { return mesh_; }

  private:
    bool error(std::string text) {
        diagnostics_.error({lines_.line(), 1}, std::move(text));
        return false;
    }
    /// Reports a file that ends within an element. The elements before it are used.
    bool ended(const Element& element) {
        error("the file ends within its " + std::to_string(element.count) + " elements '" + element.name +
              "'; those before are used");
        return !mesh_.points.empty();
    }
    bool readHeader() {
        for (bool first = true; lines_.nextLine(); first = false) {
            const std::string_view word = lines_.word();
            if (first) continue;  // "ply"
            if (word == "format") {
                const std::string_view format = lines_.word();
                const bool big = format == "binary_big_endian", little = format == "binary_little_endian";
                text_ = format == "ascii";
                swapped_ = std::endian::native == std::endian::little ? big : little;
                if (!text_ && !big && !little)
                    return error("'" + std::string(format.substr(0, 40)) + "' is no format of PLY files");
            } else if (word == "element") {
                Element element;
                element.name = lines_.word();
                std::int64_t count = 0;
                if (!lines_.integer(count) || count < 0) return error("expected 'element NAME COUNT'");
                element.count = static_cast<std::uint64_t>(count);
                elements_.push_back(std::move(element));
            } else if (word == "property") {
                if (!readPropertyLine()) return false;
            } else if (word == "end_header") {
                lines_.rest();
                at_ = static_cast<std::size_t>(lines_.at() - bytes_.data()) + 1;
                return true;
            }
        }
        return error("the header of the PLY file does not end");
    }
    bool readPropertyLine() {
        if (elements_.empty()) return error("a property stands before the first element");
        Property property;
        std::string_view type = lines_.word();
        if (type == "list") {
            property.count = numberType(lines_.word());
            if (!property.count) return error("the count of a list has no type that PLY knows");
            type = lines_.word();
        }
        const auto number = numberType(type);
        if (!number) return error("'" + std::string(type.substr(0, 40)) + "' is no type of PLY");
        property.number = *number;
        property.meaning = meaningOf(lines_.word());
        elements_.back().properties.push_back(property);
        if (elements_.back().name == "vertex") has_[static_cast<std::size_t>(property.meaning)] = true;
        if (property.meaning == Meaning::red) byteColors_ = *number != Number::f32 && *number != Number::f64;
        return true;
    }

    bool nextDataLine() { return lines_.nextLine(); }
    template <class T>
    double binary() {
        T value;
        std::memcpy(&value, bytes_.data() + at_, sizeof(T));
        if (swapped_) {
            auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
            std::ranges::reverse(raw);
            value = std::bit_cast<T>(raw);
        }
        at_ += sizeof(T);
        return static_cast<double>(value);
    }
    bool readNumber(Number type, double& out) {
        if (text_) {
            float number = 0;
            if (type != Number::f32 && type != Number::f64) {
                std::int64_t integer = 0;
                if (!lines_.integer(integer)) return false;
                out = static_cast<double>(integer);
                return true;
            }
            if (!lines_.number(number)) return false;
            out = static_cast<double>(number);
            return true;
        }
        if (at_ > bytes_.size() || bytes_.size() - at_ < kSizes[static_cast<std::size_t>(type)]) return false;
        using Read = double (PlyReader::*)();
        static constexpr Read reads[] = {&PlyReader::binary<std::int8_t>,  &PlyReader::binary<std::uint8_t>,
                                         &PlyReader::binary<std::int16_t>, &PlyReader::binary<std::uint16_t>,
                                         &PlyReader::binary<std::int32_t>, &PlyReader::binary<std::uint32_t>,
                                         &PlyReader::binary<float>,        &PlyReader::binary<double>};
        out = (this->*reads[static_cast<std::size_t>(type)])();
        return true;
    }
    bool readProperty(const Property& property, bool inFace) {
        double number = 0;
        if (!property.count) {
            if (!readNumber(property.number, number)) return false;
            values_[static_cast<std::size_t>(property.meaning)] = number;
            return true;
        }
        double count = 0;
        if (!readNumber(*property.count, count) || !(count >= 0)) return false;
        const bool wanted = inFace && property.meaning == Meaning::indices;
        for (double i = 0; i < count; ++i) {
            if (!readNumber(property.number, number)) return false;
            if (wanted) face_.push_back(number);
        }
        if (wanted) addFace();
        return true;
    }
    void addVertex() {
        const auto get = [&](Meaning meaning) {
            return static_cast<float>(values_[static_cast<std::size_t>(meaning)]);
        };
        const auto has = [&](Meaning meaning) { return has_[static_cast<std::size_t>(meaning)]; };
        mesh_.points.push_back({get(Meaning::x), get(Meaning::y), get(Meaning::z)});
        if (has(Meaning::nx)) mesh_.normals.push_back({get(Meaning::nx), get(Meaning::ny), get(Meaning::nz)});
        if (has(Meaning::s)) mesh_.texCoords.push_back({get(Meaning::s), get(Meaning::t)});
        if (has(Meaning::red)) {
            const float scale = byteColors_ ? 1.0f / 255 : 1;
            mesh_.colors.push_back({get(Meaning::red) * scale, get(Meaning::green) * scale, get(Meaning::blue) * scale,
                                    has(Meaning::alpha) ? get(Meaning::alpha) * scale : 1});
        }
    }
    void addFace() {
        const auto size = static_cast<double>(mesh_.points.size());
        const bool good = face_.size() >= 3 && std::ranges::all_of(face_, [&](double i) { return i >= 0 && i < size; });
        if (!good && !complained_) {
            complained_ = true;
            error("a face names fewer than three vertices, or one that there is not; such faces are left out");
        }
        if (good) {
            for (const double index : face_) mesh_.faces.push_back(static_cast<std::int32_t>(index));
            mesh_.faces.push_back(-1);
            allTriangles_ = allTriangles_ && face_.size() == 3;
        }
        face_.clear();
    }

  public:
    bool allTriangles() const { return allTriangles_; }

  private:
    std::string_view bytes_;
    LineScanner lines_;
    Diagnostics& diagnostics_;
    bool text_ = true, swapped_ = false, byteColors_ = true, complained_ = false, allTriangles_ = true;
    std::size_t at_ = 0;  // in a binary file
    std::vector<Element> elements_;
    std::array<double, 14> values_{};
    std::array<bool, 14> has_{};
    std::vector<double> face_;
    ImportedMesh mesh_;
};

}  // namespace

bool importPly(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    PlyReader reader(input.bytes, diagnostics);
    if (!reader.read()) return false;
    ImportedMesh& mesh = reader.mesh();
    if (mesh.points.empty()) {
        diagnostics.error({}, "the PLY file has no vertices");
        return false;
    }
    if (!mesh.faces.empty() && reader.allTriangles()) {
        Array<std::int32_t> corners;
        for (const std::int32_t index : mesh.faces)
            if (index >= 0) corners.push_back(index);
        mesh.faces = std::move(corners);
        mesh.triangles = true;
    }
    beginImported(handler, "from PLY");
    handler.beginNode("Shape", {}, {}, {});
    writeAppearance(handler, mesh.faces.empty() && mesh.normals.empty() ? "UnlitMaterial" : "Material");
    writeMesh(handler, std::move(mesh));
    handler.endNode({});
    handler.endDocument();
    return true;
}

}  // namespace rtsg::detail
