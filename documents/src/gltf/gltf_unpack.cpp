// Finds the modules that unpack meshes, and checks the counts of a file before it calls them.
#include "gltf_unpack.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <stdexcept>

#include <rtsg/core/machine.h>
#include <rtsg/core/module.h>
#include <rtsg/core/sandbox.h>

namespace rtsg::detail {

namespace {

#if !defined(RTSG_NO_DRACO) || !defined(RTSG_NO_MESHOPT)
template <class Function>
Result<Function> functionOf(const char* module, const char* symbol, std::string_view need) {
    const auto found = loadModule(module, symbol, need);
    if (!found) return std::unexpected(found.error());
    return reinterpret_cast<Function>(*found);
}
#endif

#ifndef RTSG_NO_DRACO
Result<UnpackDraco> dracoHere() {
    return functionOf<UnpackDraco>("rtsg_draco", RTSG_DRACO_SYMBOL, "meshes compressed by Draco need");
}

struct DracoJob {
    std::uint64_t maximum = 0, points = 0, indices = 0;
};
struct DracoPart {
    std::uint64_t id = 0, componentType = 0, components = 0;
};

Result<> prepareDraco() {
    const auto found = dracoHere();
    return found ? Result<>() : std::unexpected(found.error());
}
void serveDraco(SandboxJob& job) {
    std::string_view head = job.head();
    DracoJob wanted;
    takeSandboxNumbers(head, wanted);
    DracoMesh mesh{wanted.points, wanted.indices, {}, {}};
    for (DracoPart part; takeSandboxNumbers(head, part);)
        mesh.attributes.push_back({static_cast<std::uint32_t>(part.id), part.componentType, part.components, {}});
    const UnpackLimits limits{wanted.maximum, [](std::uint64_t more) { return static_cast<bool>(mayHold(more)); }};
    if (const char* why =
            (*dracoHere())({reinterpret_cast<const char*>(job.bytes().data()), job.bytes().size()}, mesh, limits))
        throw std::runtime_error(why);
    std::string all = std::move(mesh.indexBytes);
    for (const DracoAttribute& one : mesh.attributes) all += one.bytes;
    std::memcpy(job.room(all.size()).data(), all.data(), all.size());
    job.answer({});
}
constexpr SandboxTask kDracoTask{"meshes compressed by Draco", prepareDraco, serveDraco};

const char* unpackDracoSandboxed(std::string_view bytes, DracoMesh& mesh, const UnpackLimits& limits) {
    static thread_local std::string why;
    if (std::max(mesh.points, mesh.indices) > std::min(limits.maximum, std::uint64_t{1} << 40))
        return "it takes more memory than may be had";
    std::string head = sandboxText(DracoJob{limits.maximum, mesh.points, mesh.indices});
    // Sizes of component types 5120 to 5126 of glTF; others are refused by the module.
    constexpr std::uint64_t kSizes[] = {1, 1, 2, 2, 0, 4, 4};
    std::uint64_t size = mesh.indices * sizeof(std::uint32_t);
    std::vector<std::uint64_t> sizes;
    for (const DracoAttribute& one : mesh.attributes) {
        head += sandboxText(DracoPart{one.id, one.componentType, one.components});
        const std::uint64_t type = one.componentType - 5120;
        sizes.push_back(type < std::size(kSizes) ? mesh.points * one.components * kSizes[type] : 0);
        size += sizes.back();
    }
    const auto result =
        runSandboxed(kDracoTask, head, {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
    if (!result) return why = result.error().text, why.c_str();
    std::string all(result->size() == size ? size : 0, '\0');
    if (all.size() != result->size() || !result->read({reinterpret_cast<std::uint8_t*>(all.data()), all.size()}))
        return "its Draco data are damaged";
    mesh.indexBytes = all.substr(0, mesh.indices * sizeof(std::uint32_t));
    std::size_t at = mesh.indexBytes.size();
    for (std::size_t i = 0; i < sizes.size(); at += sizes[i], ++i) mesh.attributes[i].bytes = all.substr(at, sizes[i]);
    return nullptr;
}
#endif

#ifndef RTSG_NO_MESHOPT
Result<UnpackMeshopt> meshoptHere() {
    return functionOf<UnpackMeshopt>("rtsg_meshopt", RTSG_MESHOPT_SYMBOL, "meshes compressed by meshopt need");
}

struct MeshoptJob {
    std::uint64_t count = 0, stride = 0;
    MeshoptView::Mode mode = MeshoptView::Mode::attributes;
    MeshoptView::Filter filter = MeshoptView::Filter::none;
};

Result<> prepareMeshopt() {
    const auto found = meshoptHere();
    return found ? Result<>() : std::unexpected(found.error());
}
void serveMeshopt(SandboxJob& job) {
    std::string_view head = job.head();
    MeshoptJob wanted;
    takeSandboxNumbers(head, wanted);
    std::string out;
    const std::string_view bytes(reinterpret_cast<const char*>(job.bytes().data()), job.bytes().size());
    if (const char* why = (*meshoptHere())({bytes, wanted.count, wanted.stride, wanted.mode, wanted.filter}, out))
        throw std::runtime_error(why);
    std::memcpy(job.room(out.size()).data(), out.data(), out.size());
    job.answer({});
}
constexpr SandboxTask kMeshoptTask{"meshes compressed by meshopt", prepareMeshopt, serveMeshopt};

const char* unpackMeshoptSandboxed(const MeshoptView& view, std::string& out) {
    static thread_local std::string why;
    const auto result =
        runSandboxed(kMeshoptTask, sandboxText(MeshoptJob{view.count, view.stride, view.mode, view.filter}),
                     {reinterpret_cast<const std::uint8_t*>(view.bytes.data()), view.bytes.size()});
    if (!result) return why = result.error().text, why.c_str();
    if (result->size() != view.count * view.stride) return "its meshopt data are damaged";
    out.resize(result->size());
    return result->read({reinterpret_cast<std::uint8_t*>(out.data()), out.size()}) ? nullptr
                                                                                   : "its meshopt data are damaged";
}
#endif

}  // namespace

Result<UnpackDraco> dracoModule() {
#ifdef RTSG_NO_DRACO
    return fail("this build leaves meshes compressed by Draco out (libdraco-dev, RTSG_DRACO)");
#else
    auto found = dracoHere();
    if (found && isSandboxed()) return unpackDracoSandboxed;
    return found;
#endif
}

Result<UnpackMeshopt> meshoptModule() {
#ifdef RTSG_NO_MESHOPT
    return fail("this build leaves meshes compressed by meshopt out (libmeshoptimizer-dev, RTSG_MESHOPT)");
#else
    auto found = meshoptHere();
    if (found && isSandboxed()) return unpackMeshoptSandboxed;
    return found;
#endif
}

const char* misfit(const MeshoptView& view) {
    using Mode = MeshoptView::Mode;
    using Filter = MeshoptView::Filter;
    const std::size_t stride = view.stride;
    if (view.mode == Mode::attributes) {
        if (stride == 0 || stride % 4 != 0 || stride > 256) return "its elements have no size that meshopt packs";
        if (view.filter == Filter::octahedral && stride != 4 && stride != 8)
            return "its filter is for elements of 4 or 8 bytes";
        if (view.filter == Filter::quaternion && stride != 8) return "its filter is for elements of 8 bytes";
    } else {
        if (stride != 2 && stride != 4) return "its indices have neither 2 nor 4 bytes";
        if (view.filter != Filter::none) return "indices have no filter";
        if (view.mode == Mode::triangles && view.count % 3 != 0) return "its triangles have no three corners";
    }
    // The format needs one byte for 64 equal elements, for 12 bytes of triangles, and for one index.
    constexpr std::size_t kOfByte = 64;
    if (view.count > view.bytes.size() * kOfByte / stride) return "it counts more elements than its bytes can hold";
    return nullptr;
}

}  // namespace rtsg::detail
