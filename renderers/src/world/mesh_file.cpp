// Writes the triangles of a flattened scene as STL, OBJ, PLY and GLB.
#include <rtsg/renderers/mesh_file.h>

#include <cstring>
#include <map>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/flattener.h>
#include <rtsg/renderers/mesh.h>

namespace rtsg {

namespace {

/// The shapes that are seen, with their meshes.
struct Shapes {
    Flattener flattener;
    std::unordered_map<std::uint32_t, std::shared_ptr<const Mesh>> meshes;
    std::vector<const Instance*> instances;
    MeshFileContent content;

    explicit Shapes(const Scene& scene) {
        const InstanceDelta& delta = flattener.apply(scene, scene.snapshot());
        for (const auto& geometry : delta.geometries) meshes[geometry.node.value] = geometry.mesh;
        for (const Instance& instance : flattener.instances()) {
            if (!instance.id || !instance.seen || instance.volume || instance.boundingBox) continue;
            const auto found = meshes.find(instance.geometry.value);
            if (found == meshes.end() || !found->second || found->second->empty()) continue;
            instances.push_back(&instance);
            ++content.shapes;
            content.triangles += found->second->triangleCount;
        }
    }
    const Mesh& meshOf(const Instance& instance) const { return *meshes.at(instance.geometry.value); }
};

class Output {
  public:
    explicit Output(OutputFile& file) : file_(file) {}
    ~Output() = default;
    template <class T>
    void put(T value) {
        text_.append(reinterpret_cast<const char*>(&value), sizeof(value));
        flushIfFull();
    }
    template <class... Parts>
    void print(fmt::format_string<Parts...> format, Parts&&... parts) {
        fmt::format_to(std::back_inserter(text_), format, std::forward<Parts>(parts)...);
        flushIfFull();
    }
    void write(std::string_view text) {
        text_ += text;
        flushIfFull();
    }
    Result<> finish() {
        flush();
        return result_;
    }

  private:
    void flush() {
        if (result_) result_ = file_.write(text_);
        text_.clear();
    }
    void flushIfFull() {
        constexpr std::size_t full = 1 << 16;
        if (text_.size() >= full) flush();
    }
    OutputFile& file_;
    std::string text_;
    Result<> result_;
};

Vec3f placed(const WorldFromLocal& m, Vec3f p) {
    return Vec3f(m * glm::dvec4(Vec3d(p), 1.0));
}

/// Mirrored shapes show their other side unless two corners change places.
template <class Visit>
void forEachTriangle(const Shapes& shapes, const Visit& visit) {
    for (const Instance* instance : shapes.instances) {
        const Mesh& mesh = shapes.meshOf(*instance);
        const bool mirrored = determinantSign(instance->worldFromLocal) < 0;
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
            visit(placed(instance->worldFromLocal, mesh.vertex(t, 0)),
                  placed(instance->worldFromLocal, mesh.vertex(t, mirrored ? 2 : 1)),
                  placed(instance->worldFromLocal, mesh.vertex(t, mirrored ? 1 : 2)));
    }
}

Vec3f unitNormal(Vec3f a, Vec3f b, Vec3f c) {
    const Vec3d n = glm::cross(Vec3d(b) - Vec3d(a), Vec3d(c) - Vec3d(a));
    const double length = glm::length(n);
    return length > 0 ? Vec3f(n / length) : Vec3f(0);
}

void writeStl(const Shapes& shapes, Output& out) {
    std::string head = "binary STL";
    head.resize(80, ' ');
    out.write(head);
    out.put(static_cast<std::uint32_t>(shapes.content.triangles));
    forEachTriangle(shapes, [&](Vec3f a, Vec3f b, Vec3f c) {
        for (const Vec3f v : {unitNormal(a, b, c), a, b, c}) {
            out.put(v.x);
            out.put(v.y);
            out.put(v.z);
        }
        out.put(std::uint16_t{0});
    });
}

void writePly(const Shapes& shapes, Output& out) {
    std::size_t points = 0;
    for (const Instance* instance : shapes.instances) points += shapes.meshOf(*instance).positions.size();
    out.print(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
        "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        points, shapes.content.triangles);
    for (const Instance* instance : shapes.instances)
        for (const Vec3f& point : shapes.meshOf(*instance).positions) {
            const Vec3f p = placed(instance->worldFromLocal, point);
            out.put(p.x);
            out.put(p.y);
            out.put(p.z);
        }
    std::int32_t first = 0;
    for (const Instance* instance : shapes.instances) {
        const Mesh& mesh = shapes.meshOf(*instance);
        const bool mirrored = determinantSign(instance->worldFromLocal) < 0;
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t) {
            out.put(std::uint8_t{3});
            for (const std::uint32_t corner : {0u, mirrored ? 2u : 1u, mirrored ? 1u : 2u})
                out.put(first + static_cast<std::int32_t>(mesh.vertexIndex(t, corner)));
        }
        first += static_cast<std::int32_t>(mesh.positions.size());
    }
}

void writeObj(const Scene& scene, const Shapes& shapes, Output& out) {
    std::size_t first = 1, firstNormal = 1, firstCoord = 1;
    for (const Instance* instance : shapes.instances) {
        const VertexArrays arrays = vertexArrays(shapes.meshOf(*instance));
        const std::string_view name = scene.name(instance->shape);
        out.print("o {}\n", name.empty() ? fmt::format("shape{}", instance->id.slot) : std::string(name));
        const glm::dmat3 normals = glm::transpose(glm::inverse(glm::dmat3(instance->worldFromLocal)));
        const bool mirrored = determinantSign(instance->worldFromLocal) < 0;
        for (const Vec3f& point : arrays.positions) {
            const Vec3f p = placed(instance->worldFromLocal, point);
            out.print("v {} {} {}\n", p.x, p.y, p.z);
        }
        for (const Vec2f& t : arrays.texCoords) out.print("vt {} {}\n", t.x, t.y);
        for (const Vec3f& normal : arrays.normals) {
            Vec3d n = normals * Vec3d(normal);
            const double length = glm::length(n);
            if (length > 0 && std::isfinite(length)) n /= length;
            out.print("vn {} {} {}\n", static_cast<float>(n.x), static_cast<float>(n.y), static_cast<float>(n.z));
        }
        const bool coords = arrays.texCoords.size() == arrays.positions.size();
        for (std::size_t i = 0; i + 2 < arrays.triangles.size(); i += 3) {
            out.write("f");
            for (const std::size_t corner : {i, mirrored ? i + 2 : i + 1, mirrored ? i + 1 : i + 2}) {
                const std::size_t v = arrays.triangles[corner];
                if (coords)
                    out.print(" {}/{}/{}", first + v, firstCoord + v, firstNormal + v);
                else
                    out.print(" {}//{}", first + v, firstNormal + v);
            }
            out.write("\n");
        }
        first += arrays.positions.size();
        firstNormal += arrays.normals.size();
        firstCoord += arrays.texCoords.size();
    }
}

/// The pieces of a GLB: lists of JSON objects, and the bytes that they refer to.
class GlbWriter {
  public:
    GlbWriter(const Scene& scene, const Shapes& shapes) : scene_(scene) {
        for (const Instance* instance : shapes.instances) {
            const Mesh& mesh = shapes.meshOf(*instance);
            addNode(*instance, meshNumber(mesh, *instance));
        }
    }
    void write(Output& out) {
        std::string nodes;
        for (std::size_t i = 0; i < nodeCount_; ++i) nodes += fmt::format("{}{}", i ? "," : "", i);
        pad(binary_, '\0');
        std::string json = fmt::format(
            R"({{"asset":{{"version":"2.0","generator":"RTSG"}},"scene":0,"scenes":[{{"nodes":[{}]}}],"nodes":[{}],"meshes":[{}],)"
            R"("accessors":[{}],"bufferViews":[{}],"materials":[{}],"buffers":[{{"byteLength":{}}}])",
            nodes, nodes_, meshes_, accessors_, views_, materials_, binary_.size());
        if (!images_.empty()) json += fmt::format(R"(,"images":[{}],"textures":[{}])", images_, textures_);
        json += '}';
        pad(json, ' ');
        out.write("glTF");
        out.put(std::uint32_t{2});
        out.put(static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + binary_.size()));
        out.put(static_cast<std::uint32_t>(json.size()));
        out.write("JSON");
        out.write(json);
        out.put(static_cast<std::uint32_t>(binary_.size()));
        out.write(std::string_view("BIN\0", 4));
        out.write(binary_);
    }
    /// Lengths are numbers of 32 bits.
    bool fits() const { return binary_.size() + accessors_.size() + nodes_.size() < 0xF0000000u; }

  private:
    static void pad(std::string& bytes, char with) { bytes.resize((bytes.size() + 3) / 4 * 4, with); }
    static void append(std::string& list, std::size_t& count, const std::string& item) {
        list += (count++ ? "," : "") + item;
    }
    template <class T>
    std::size_t accessor(const Array<T>& values, const char* type, std::size_t component,
                         const std::string& more = {}) {
        pad(binary_, '\0');
        append(views_, viewCount_,
               fmt::format(R"({{"buffer":0,"byteOffset":{},"byteLength":{}}})", binary_.size(),
                           values.size() * sizeof(T)));
        binary_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
        append(accessors_, accessorCount_,
               fmt::format(R"({{"bufferView":{},"componentType":{},"count":{},"type":"{}"{}}})", viewCount_ - 1,
                           component, values.size(), type, more));
        return accessorCount_ - 1;
    }
    std::string primitiveOf(const Mesh& mesh, NodeId geometry) {
        auto& known = primitives_[geometry.value];
        if (!known.empty()) return known;
        constexpr std::size_t f32 = 5126, u32 = 5125;
        VertexArrays arrays = vertexArrays(mesh);
        Bounds bounds;
        for (const Vec3f& p : arrays.positions) bounds.extend(p);
        const std::string limits = fmt::format(R"(,"min":[{},{},{}],"max":[{},{},{}])", bounds.min.x, bounds.min.y,
                                               bounds.min.z, bounds.max.x, bounds.max.y, bounds.max.z);
        std::string attributes = fmt::format(R"("POSITION":{})", accessor(arrays.positions, "VEC3", f32, limits));
        if (!arrays.normals.empty())
            attributes += fmt::format(R"(,"NORMAL":{})", accessor(arrays.normals, "VEC3", f32));
        if (!arrays.texCoords.empty()) {
            Array<Vec2f> flipped = arrays.texCoords;  // pictures begin at their upper left corner there
            for (std::size_t i = 0; i < flipped.size(); ++i)
                flipped.mutableData()[i].y = 1 - flipped.mutableData()[i].y;
            attributes += fmt::format(R"(,"TEXCOORD_0":{})", accessor(flipped, "VEC2", f32));
        }
        if (!arrays.colors.empty()) attributes += fmt::format(R"(,"COLOR_0":{})", accessor(arrays.colors, "VEC4", f32));
        known =
            fmt::format(R"("attributes":{{{}}},"indices":{})", attributes, accessor(arrays.triangles, "SCALAR", u32));
        return known;
    }
    std::size_t meshNumber(const Mesh& mesh, const Instance& instance) {
        const auto [found, isNew] =
            meshNumbers_.try_emplace({instance.geometry.value, instance.appearance.value}, meshCount_);
        if (isNew)
            append(meshes_, meshCount_,
                   fmt::format(R"({{"primitives":[{{{},"material":{}}}]}})", primitiveOf(mesh, instance.geometry),
                               materialNumber(instance.appearance, mesh.solid)));
        return found->second;
    }
    template <class T>
    T fieldOf(const Node* node, std::string_view name, T otherwise) const {
        const FieldIndex index = node ? node->type().findExact(name) : kNoField;
        if (index == kNoField || node->type().fields[index].type != FieldTypeOf<T>::value) return otherwise;
        return *static_cast<const T*>(node->storage(index));
    }
    const Node* childOf(const Node* node, std::string_view name) const {
        const NodeId id = fieldOf(node, name, NodeId{});
        return id ? scene_.find(id) : nullptr;
    }
    std::string texture(const Node* node, const char* name) {
        const Array<String> urls = fieldOf(node, "url", Array<String>());
        if (!node || urls.empty()) return {};
        append(images_, imageCount_, fmt::format(R"({{"uri":{}}})", jsonString(urls[0].view())));
        append(textures_, textureCount_, fmt::format(R"({{"source":{}}})", imageCount_ - 1));
        return fmt::format(R"(,"{}":{{"index":{}}})", name, textureCount_ - 1);
    }
    std::size_t materialNumber(NodeId appearanceId, bool solid) {
        const auto [found, isNew] = materialNumbers_.try_emplace({appearanceId.value, solid}, materialCount_);
        if (!isNew) return found->second;
        const Node* appearance = appearanceId ? scene_.find(appearanceId) : nullptr;
        const Node* material = childOf(appearance, "material");
        const bool physical = material && material->is(x3d::PhysicalMaterial::type);
        const bool unlit = !material || material->is(x3d::UnlitMaterial::type);
        const Color color = fieldOf(material,
                                    unlit      ? "emissiveColor"
                                    : physical ? "baseColor"
                                               : "diffuseColor",
                                    Color{1, 1, 1});
        const Color glow = unlit ? Color{0, 0, 0} : fieldOf(material, "emissiveColor", Color{0, 0, 0});
        const float opacity = 1 - fieldOf(material, "transparency", 0.0f);
        const Node* base = childOf(material, physical ? "baseTexture" : unlit ? "emissiveTexture" : "diffuseTexture");
        if (!base) base = childOf(appearance, "texture");
        const std::string mode = fieldOf(appearance, "alphaMode", String("AUTO")).str();
        std::string text = fmt::format(
            R"({{"pbrMetallicRoughness":{{"baseColorFactor":[{},{},{},{}],"metallicFactor":{},"roughnessFactor":{}{}{}}},)"
            R"("emissiveFactor":[{},{},{}],"doubleSided":{},"alphaMode":"{}")",
            color.r, color.g, color.b, opacity, physical ? fieldOf(material, "metallic", 1.0f) : 0.0f,
            physical ? fieldOf(material, "roughness", 1.0f) : 1.0f, texture(base, "baseColorTexture"),
            texture(childOf(material, "metallicRoughnessTexture"), "metallicRoughnessTexture"), glow.r, glow.g, glow.b,
            !solid,
            mode == "MASK" || mode == "BLEND" || mode == "OPAQUE" ? mode
            : opacity < 1                                         ? "BLEND"
                                                                  : "OPAQUE");
        text += texture(childOf(material, "normalTexture"), "normalTexture");
        text += texture(childOf(material, "occlusionTexture"), "occlusionTexture");
        if (!unlit) text += texture(childOf(material, "emissiveTexture"), "emissiveTexture");
        append(materials_, materialCount_, text + "}");
        return found->second;
    }
    void addNode(const Instance& instance, std::size_t mesh) {
        const WorldFromLocal& m = instance.worldFromLocal;
        std::string matrix;
        for (int c = 0; c < 4; ++c)
            for (int r = 0; r < 4; ++r)
                matrix += fmt::format("{}{}", matrix.empty() ? "" : ",", r < 3 ? m[c][r] : c == 3 ? 1.0 : 0.0);
        const std::string_view name = scene_.name(instance.shape);
        append(nodes_, nodeCount_,
               fmt::format(R"({{"mesh":{},"matrix":[{}]{}}})", mesh, matrix,
                           name.empty() ? std::string() : ",\"name\":" + jsonString(name)));
    }

    const Scene& scene_;
    std::string nodes_, meshes_, accessors_, views_, materials_, images_, textures_, binary_;
    std::size_t nodeCount_ = 0, meshCount_ = 0, accessorCount_ = 0, viewCount_ = 0, materialCount_ = 0, imageCount_ = 0,
                textureCount_ = 0;
    std::unordered_map<std::uint32_t, std::string> primitives_;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> meshNumbers_;
    std::map<std::pair<std::uint32_t, bool>, std::size_t> materialNumbers_;
};

}  // namespace

bool meshFormatFromName(const std::filesystem::path& file, MeshFormat& format) {
    constexpr std::pair<std::string_view, MeshFormat> known[] = {
        {".stl", MeshFormat::stl}, {".obj", MeshFormat::obj}, {".ply", MeshFormat::ply}, {".glb", MeshFormat::glb}};
    const std::string extension = file.extension();
    for (const auto& [name, its] : known)
        if (name == extension) {
            format = its;
            return true;
        }
    return false;
}

Result<MeshFileContent> writeMeshFile(const Scene& scene, const std::filesystem::path& file, MeshFormat format,
                                      Diagnostics& diagnostics, Existing existing) {
    const Shapes shapes(scene);
    diagnostics.append(shapes.flattener.diagnostics());
    if (shapes.content.triangles == 0) return fail("the scene shows no triangles", {}, file.string());
    if (shapes.content.triangles > 0x7FFFFFFF / 3) return fail("the scene has too many triangles", {}, file.string());
    auto created = OutputFile::create(file, existing);
    if (!created) return std::unexpected(created.error());
    Output out(*created);
    if (format == MeshFormat::stl) {
        writeStl(shapes, out);
    } else if (format == MeshFormat::ply) {
        writePly(shapes, out);
    } else if (format == MeshFormat::obj) {
        writeObj(scene, shapes, out);
    } else {
        GlbWriter writer(scene, shapes);
        if (!writer.fits()) return fail("a GLB file has at most 4 GiB", {}, file.string());
        writer.write(out);
    }
    if (auto ok = out.finish(); !ok) return std::unexpected(ok.error());
    if (auto ok = created->commit(); !ok) return std::unexpected(ok.error());
    return shapes.content;
}

}  // namespace rtsg
