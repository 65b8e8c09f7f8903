// Finds the modules that unpack meshes, and checks the counts of a file before it calls them.
#include "gltf_unpack.h"

#include <rtsg/core/module.h>

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

}  // namespace

Result<UnpackDraco> dracoModule() {
#ifdef RTSG_NO_DRACO
    return fail("this build leaves meshes compressed by Draco out (libdraco-dev, RTSG_DRACO)");
#else
    return functionOf<UnpackDraco>("rtsg_draco", RTSG_DRACO_SYMBOL, "meshes compressed by Draco need");
#endif
}

Result<UnpackMeshopt> meshoptModule() {
#ifdef RTSG_NO_MESHOPT
    return fail("this build leaves meshes compressed by meshopt out (libmeshoptimizer-dev, RTSG_MESHOPT)");
#else
    return functionOf<UnpackMeshopt>("rtsg_meshopt", RTSG_MESHOPT_SYMBOL, "meshes compressed by meshopt need");
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
