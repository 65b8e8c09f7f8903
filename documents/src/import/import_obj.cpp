// OBJ with its material libraries: one shape for each run of faces of one material, all on the same coordinates.
#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "import.h"
#include "imported_names.h"
#include "text/utf8.h"

namespace rtsg::detail {

namespace {

struct ObjMaterial {
    Color diffuse{0.8f, 0.8f, 0.8f}, specular{0, 0, 0}, emissive{0, 0, 0};
    float shininess = 0, transparency = 0;
    std::string texture, normalTexture;
    std::string def{};  // once it has been written
};

/// The shapes of a file: one for each group and material.
struct ObjShape {
    std::string name, material, def{};
    std::vector<std::int32_t> points, texCoords, normals;  // as ImportedMesh has them; numbers of the whole file
    bool hasTexCoords = true, hasNormals = true;
};

class ObjReader {
  public:
    ObjReader(const ImportInput& input, Diagnostics& diagnostics)
        : input_(input), lines_(input.bytes), diagnostics_(diagnostics) {}

    void read() {
        while (lines_.nextLine()) {
            const std::string_view word = lines_.word();
            if (word == "v") {
                readPoint();
            } else if (word == "vn") {
                readVector(normals_);
            } else if (word == "vt") {
                Vec2f& t = texCoords_.emplace_back(0.0f, 0.0f);
                if (!lines_.number(t.x)) complain("expected a texture coordinate");
                lines_.number(t.y);
            } else if (word == "f") {
                readFace();
            } else if (word == "o" || word == "g") {
                name_ = lines_.rest();
                current_ = nullptr;
            } else if (word == "usemtl") {
                material_ = lines_.rest();
                current_ = nullptr;
                if (!materials_.empty() && !materials_.contains(material_))
                    diagnostics_.warning({lines_.line(), 1}, "there is no material " + material_.substr(0, 80));
            } else if (word == "mtllib") {
                readLibrary(lines_.rest());
            } else if (!word.empty() && word[0] != '#' && word != "s") {
                leftOut(word);
            }
        }
    }
    bool write(DocumentHandler& handler) {
        std::erase_if(shapes_, [](const ObjShape& shape) { return shape.points.empty(); });
        if (shapes_.empty() && points_.empty()) {
            diagnostics_.error({}, "the OBJ file has no vertices");
            return false;
        }
        beginImported(handler, "from OBJ");
        if (shapes_.empty()) shapes_.emplace_back();
        for (ObjShape& shape : shapes_) shape.def = names_.take(shape.name);  // before those of materials
        for (const ObjShape& shape : shapes_) writeShape(handler, shape);
        handler.endDocument();
        return true;
    }

  private:
    void complain(std::string text) { diagnostics_.error({lines_.line(), 1}, std::move(text)); }
    /// Reports each word once: points, lines, curves, surfaces, and words that are not OBJ.
    void leftOut(std::string_view word) {
        constexpr std::size_t maximum = 40;
        if (leftOut_.size() < maximum && leftOut_.emplace(word.substr(0, maximum)).second)
            diagnostics_.warning({lines_.line(), 1}, "what '" + std::string(word.substr(0, maximum)) +
                                                         "' says is not imported; only faces and their materials are");
    }
    void readPoint() {
        Vec3f& point = points_.emplace_back(0.0f, 0.0f, 0.0f);
        if (!lines_.number(point.x) || !lines_.number(point.y) || !lines_.number(point.z))
            return complain("expected three numbers behind v");
        // Many programs put a colour behind the place; a single number is a weight.
        float color[3];
        if (!lines_.number(color[0]) || !lines_.number(color[1]) || !lines_.number(color[2])) return;
        colors_.resize(points_.size() - 1, ColorRGBA{1, 1, 1, 1});
        colors_.push_back({color[0], color[1], color[2], 1});
    }
    void readVector(std::vector<Vec3f>& into) {
        Vec3f& v = into.emplace_back(0.0f, 0.0f, 0.0f);
        if (!lines_.number(v.x) || !lines_.number(v.y) || !lines_.number(v.z)) complain("expected three numbers");
    }
    /// One of `1`, `1/2`, `1/2/3`, `1//3`; counted from 1, or from the last one back where negative.
    bool readCorner(std::string_view word, std::int64_t (&out)[3]) {
        const std::size_t sizes[3] = {points_.size(), texCoords_.size(), normals_.size()};
        for (int part = 0; part < 3; ++part) {
            const std::string_view digits = word.substr(0, std::min(word.find('/'), word.size()));
            word.remove_prefix(std::min(digits.size() + 1, word.size()));
            out[part] = -1;
            if (digits.empty()) continue;
            LineScanner scanner(digits);
            std::int64_t number = 0;
            if (!scanner.integer(number)) return false;
            const auto size = static_cast<std::int64_t>(sizes[part]);
            out[part] = number > 0 ? number - 1 : size + number;
            if (number == 0 || out[part] < 0 || out[part] >= size) return false;
        }
        return out[0] >= 0;
    }
    void readFace() {
        if (!current_) {
            current_ = &shapes_.emplace_back();
            current_->name = name_;
            current_->material = material_;
        }
        std::int64_t corner[3];
        face_.clear();
        for (std::string_view word = lines_.word(); !word.empty(); word = lines_.word()) {
            if (!readCorner(word, corner))
                return complain("'" + std::string(word.substr(0, 40)) + "' names no vertex; the face is left out");
            face_.insert(face_.end(), {corner[0], corner[1], corner[2]});
        }
        if (face_.size() < 9) return complain("a face has at least three vertices; it is left out");
        for (std::size_t i = 0; i < face_.size(); i += 3) {
            current_->points.push_back(static_cast<std::int32_t>(face_[i]));
            current_->texCoords.push_back(static_cast<std::int32_t>(face_[i + 1]));
            current_->normals.push_back(static_cast<std::int32_t>(face_[i + 2]));
            current_->hasTexCoords = current_->hasTexCoords && face_[i + 1] >= 0;
            current_->hasNormals = current_->hasNormals && face_[i + 2] >= 0;
        }
        current_->points.push_back(-1);
        current_->texCoords.push_back(-1);
        current_->normals.push_back(-1);
    }

    void readLibrary(std::string_view url) {
        const auto text = input_.open ? input_.open(url) : fail("no other file may be opened");
        if (!text)
            return diagnostics_.warning({lines_.line(), 1},
                                        "the material library " + std::string(url) + ": " + text.error().text);
        LineScanner lines(*text);
        ObjMaterial* open = nullptr;
        const auto color = [&](Color& out) {
            return lines.number(out.r) && lines.number(out.g) && lines.number(out.b);
        };
        // Options stand before the file's name: the last word is it.
        const auto file = [&](std::string& out) {
            const std::string_view rest = lines.rest();
            const std::size_t option = rest.rfind(' ');
            out = rest.starts_with('-') && option != rest.npos ? rest.substr(option + 1) : rest;
            std::ranges::replace(out, '\\', '/');
        };
        while (lines.nextLine()) {
            const std::string_view word = lines.word();
            if (word == "newmtl") open = &materials_[std::string(lines.rest())];
            if (!open) continue;
            float number = 0;
            if (word == "Kd") {
                color(open->diffuse);
            } else if (word == "Ks") {
                color(open->specular);
            } else if (word == "Ke") {
                color(open->emissive);
            } else if (word == "Ns" && lines.number(number)) {
                open->shininess = std::clamp(number / 128, 0.0f, 1.0f);  // the exponent of X3D is 128 times that
            } else if (word == "d" && lines.number(number)) {
                open->transparency = std::clamp(1 - number, 0.0f, 1.0f);
            } else if (word == "Tr" && lines.number(number)) {
                open->transparency = std::clamp(number, 0.0f, 1.0f);
            } else if (word == "map_Kd") {
                file(open->texture);
            } else if (word == "norm") {
                file(open->normalTexture);
            }
        }
    }

    /// The format knows no encoding.
    static std::string asText(std::string_view bytes) {
        std::size_t replaced = 0;
        return replaceInvalidUtf8(bytes, replaced);
    }
    static void texture(DocumentHandler& handler, const std::string& url, const char* field) {
        if (url.empty()) return;
        handler.beginNode("ImageTexture", {}, field, {});
        handler.setField("url", Value(Array<String>{String(asText(url))}), {});
        handler.endNode({});
    }
    void writeAppearance(DocumentHandler& handler, const std::string& name) {
        handler.beginNode("Appearance", {}, "appearance", {});
        const auto found = materials_.find(name);
        const bool isThere = found != materials_.end();
        if (isThere && !found->second.def.empty())
            handler.useNode(found->second.def, "material", {});
        else
            writeMaterial(handler, isThere ? found->second : ObjMaterial(),
                          isThere ? found->second.def = names_.take(name, "material") : std::string());
        handler.endNode({});
    }
    static void writeMaterial(DocumentHandler& handler, const ObjMaterial& material, const std::string& def) {
        handler.beginNode("Material", def, "material", {});
        // A texture's colours are multiplied by the material's.
        handler.setField("diffuseColor", Value(material.diffuse), {});
        handler.setField("specularColor", Value(material.specular), {});
        handler.setField("emissiveColor", Value(material.emissive), {});
        if (material.shininess > 0) handler.setField("shininess", Value(material.shininess), {});
        if (material.transparency > 0) handler.setField("transparency", Value(material.transparency), {});
        texture(handler, material.texture, "diffuseTexture");
        texture(handler, material.normalTexture, "normalTexture");
        handler.endNode({});
    }
    /// The elements that `indices` name, each once, in the order in which they come; `indices` are then their numbers.
    template <class T>
    static Array<T> used(const std::vector<T>& all, Array<std::int32_t>& indices, std::vector<std::int32_t>& numbers) {
        numbers.assign(all.size(), -1);
        Array<T> result;
        std::int32_t* index = indices.mutableData();
        for (std::size_t i = 0; i < indices.size(); ++i) {
            if (index[i] < 0) continue;
            std::int32_t& number = numbers[static_cast<std::size_t>(index[i])];
            if (number < 0) {
                number = static_cast<std::int32_t>(result.size());
                result.push_back(all[static_cast<std::size_t>(index[i])]);
            }
            index[i] = number;
        }
        return result;
    }
    void writeShape(DocumentHandler& handler, const ObjShape& shape) {
        ImportedMesh mesh;
        const auto copied = [](const std::vector<std::int32_t>& list) {
            Array<std::int32_t> result;
            result.append({list.data(), list.size()});
            return result;
        };
        if (shape.points.empty()) {
            mesh.points.append({points_.data(), points_.size()});
            colors_.resize(colors_.empty() ? 0 : points_.size(), ColorRGBA{1, 1, 1, 1});
            mesh.colors.append({colors_.data(), colors_.size()});
        } else {
            mesh.faces = copied(shape.points);
            if (!colors_.empty()) {
                colors_.resize(points_.size(), ColorRGBA{1, 1, 1, 1});
                Array<std::int32_t> same = mesh.faces;
                mesh.colors = used(colors_, same, numbers_);
            }
            mesh.points = used(points_, mesh.faces, numbers_);
            if (shape.hasTexCoords) {
                mesh.texCoordIndex = copied(shape.texCoords);
                mesh.texCoords = used(texCoords_, mesh.texCoordIndex, numbers_);
            }
            if (shape.hasNormals) {
                mesh.normalIndex = copied(shape.normals);
                mesh.normals = used(normals_, mesh.normalIndex, numbers_);
            }
        }
        handler.beginNode("Shape", shape.def, {}, {});
        if (mesh.faces.empty() && mesh.normals.empty())
            rtsg::detail::writeAppearance(handler, "UnlitMaterial");
        else
            writeAppearance(handler, shape.material);
        writeMesh(handler, std::move(mesh));
        handler.endNode({});
    }

    const ImportInput& input_;
    LineScanner lines_;
    Diagnostics& diagnostics_;
    std::vector<Vec3f> points_, normals_;
    std::vector<Vec2f> texCoords_;
    std::vector<ColorRGBA> colors_;
    std::map<std::string, ObjMaterial> materials_;
    std::vector<ObjShape> shapes_;
    ObjShape* current_ = nullptr;
    std::string name_, material_;
    std::set<std::string, std::less<>> leftOut_;
    std::vector<std::int64_t> face_;
    std::vector<std::int32_t> numbers_;
    UniqueNames names_;
};

}  // namespace

bool importObj(const ImportInput& input, DocumentHandler& handler, Diagnostics& diagnostics) {
    ObjReader reader(input, diagnostics);
    reader.read();
    return reader.write(handler);
}

}  // namespace rtsg::detail
