// The module librtsg_draco.so: meshes compressed by Draco, by libdraco. It does not link this project's libraries, and
// throws nothing.
#include <algorithm>
#include <exception>
#include <memory>
#include <new>

#include <draco/compression/mesh/mesh_edgebreaker_decoder.h>
#include <draco/compression/mesh/mesh_sequential_decoder.h>
#include <draco/core/varint_decoding.h>

#include "gltf/gltf_unpack.h"

namespace {

using rtsg::detail::DracoAttribute;
using rtsg::detail::DracoMesh;
using rtsg::detail::UnpackLimits;

/// The memory limit of the decoder; decoding ends where it would exceed it.
struct Bounds {
    const DracoMesh& wanted;
    const UnpackLimits& limits;
    const char* why = nullptr;

    bool refuse(const char* reason) {
        why = reason;
        return false;
    }
    bool may(std::uint64_t bytes) {
        if (bytes <= limits.maximum && limits.mayHold(bytes)) return true;
        return refuse("it takes more memory than may be had");
    }
    /// Connectivity: the tables of corners and vertices, and one more of corners for each set of seams.
    bool connectivity(std::uint64_t faces, std::uint64_t seams) {
        if (wanted.indices != 3 * faces) return refuse("it has another number of triangles than its accessor says");
        constexpr std::uint64_t kFace = 160, kSeams = 40;
        return may(faces * (kFace + seams * kSeams));
    }
    /// Each attribute takes memory three times: as coded numbers, as values, and as output.
    bool attributes(const draco::PointCloud& cloud) {
        if (cloud.num_points() != wanted.points)
            return refuse("it has another number of points than its accessors say");
        std::uint64_t bytes = 0;
        constexpr std::uint64_t kCopies = 3, kWidest = 8, kMapping = 8;
        for (int i = 0; i < cloud.num_attributes(); ++i)
            bytes += cloud.num_points() *
                     (kMapping + kCopies * kWidest * static_cast<std::uint64_t>(cloud.attribute(i)->num_components()));
        return may(bytes);
    }
};

class Edgebreaker final : public draco::MeshEdgebreakerDecoder {
  public:
    explicit Edgebreaker(Bounds& bounds) : bounds_(bounds) {}

  private:
    bool DecodeConnectivity() override {
        draco::DecoderBuffer ahead = *buffer();
        std::uint32_t vertices = 0, faces = 0;
        std::uint8_t seams = 0;
        return draco::DecodeVarint(&vertices, &ahead) && draco::DecodeVarint(&faces, &ahead) && ahead.Decode(&seams) &&
               bounds_.connectivity(faces, seams) && MeshEdgebreakerDecoder::DecodeConnectivity();
    }
    bool DecodeAllAttributes() override {
        return bounds_.attributes(*point_cloud()) && MeshEdgebreakerDecoder::DecodeAllAttributes();
    }
    Bounds& bounds_;
};

class Sequential final : public draco::MeshSequentialDecoder {
  public:
    explicit Sequential(Bounds& bounds) : bounds_(bounds) {}

  private:
    bool DecodeConnectivity() override {
        draco::DecoderBuffer ahead = *buffer();
        std::uint32_t faces = 0;
        return draco::DecodeVarint(&faces, &ahead) && bounds_.connectivity(faces, 0) &&
               MeshSequentialDecoder::DecodeConnectivity();
    }
    bool DecodeAllAttributes() override {
        return bounds_.attributes(*point_cloud()) && MeshSequentialDecoder::DecodeAllAttributes();
    }
    Bounds& bounds_;
};

template <class T>
bool copyAll(const draco::PointAttribute& from, std::size_t points, DracoAttribute& to) {
    to.bytes.resize(points * to.components * sizeof(T));
    T* out = reinterpret_cast<T*>(to.bytes.data());
    for (std::size_t i = 0; i < points; ++i, out += to.components) {
        const auto value = from.mapped_index(draco::PointIndex(static_cast<std::uint32_t>(i)));
        if (value.value() >= from.size() || !from.ConvertValue(value, static_cast<std::int8_t>(to.components), out))
            return false;
    }
    return true;
}

bool copyAttribute(const draco::PointAttribute& from, std::size_t points, DracoAttribute& to) {
    switch (to.componentType) {
        case 5120:
            return copyAll<std::int8_t>(from, points, to);
        case 5121:
            return copyAll<std::uint8_t>(from, points, to);
        case 5122:
            return copyAll<std::int16_t>(from, points, to);
        case 5123:
            return copyAll<std::uint16_t>(from, points, to);
        case 5125:
            return copyAll<std::uint32_t>(from, points, to);
        case 5126:
            return copyAll<float>(from, points, to);
        default:
            return false;
    }
}

const char* takeMesh(const draco::Mesh& mesh, DracoMesh& into) {
    into.indexBytes.resize(std::size_t{mesh.num_faces()} * 3 * sizeof(std::uint32_t));
    auto* out = reinterpret_cast<std::uint32_t*>(into.indexBytes.data());
    for (std::uint32_t f = 0; f < mesh.num_faces(); ++f)
        for (const draco::PointIndex& corner : mesh.face(draco::FaceIndex(f))) *out++ = corner.value();
    for (DracoAttribute& one : into.attributes) {
        const draco::PointAttribute* from = mesh.GetAttributeByUniqueId(one.id);
        if (!from) return "it lacks an attribute that the file names";
        if (!copyAttribute(*from, mesh.num_points(), one)) return "an attribute of it is damaged";
    }
    return nullptr;
}

const char* unpack(std::string_view bytes, DracoMesh& into, const UnpackLimits& limits) {
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::DecoderBuffer ahead = buffer;
    draco::DracoHeader header;
    if (!draco::PointCloudDecoder::DecodeHeader(&ahead, &header).ok()) return "it is no Draco data";
    if (header.version_major != 2 || header.version_minor != 2) return "it is of another Draco bitstream than 2.2";
    if (header.encoder_type != draco::TRIANGULAR_MESH) return "it is no mesh";
    Bounds bounds{into, limits};
    std::unique_ptr<draco::MeshDecoder> decoder;
    if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING)
        decoder = std::make_unique<Edgebreaker>(bounds);
    else
        decoder = std::make_unique<Sequential>(bounds);
    draco::Mesh mesh;
    if (!decoder->Decode(draco::DecoderOptions(), &buffer, &mesh).ok())
        return bounds.why ? bounds.why : "its Draco data are damaged";
    return takeMesh(mesh, into);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* rtsg_unpack_draco_1(std::string_view bytes,
                                                                                  DracoMesh& mesh,
                                                                                  const UnpackLimits& limits) {
    try {
        return unpack(bytes, mesh, limits);
    } catch (const std::bad_alloc&) {
        return "it takes more memory than there is";
    } catch (const std::exception&) {
        return "its Draco data are damaged";
    }
}
