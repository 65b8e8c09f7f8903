// The module librtsg_meshopt.so: buffer views compressed by meshopt, by libmeshoptimizer. It does not link this
// project's libraries, and throws nothing.
#include <new>

#include <meshoptimizer.h>

#include "gltf/gltf_unpack.h"

namespace {

using rtsg::detail::MeshoptView;

const char* unpack(const MeshoptView& view, std::string& out) {
    const auto* in = reinterpret_cast<const unsigned char*>(view.bytes.data());
    const std::size_t size = view.bytes.size();
    out.assign(view.count * view.stride, '\0');
    int problem = 0;
    switch (view.mode) {
        case MeshoptView::Mode::attributes:
            problem = meshopt_decodeVertexBuffer(out.data(), view.count, view.stride, in, size);
            break;
        case MeshoptView::Mode::triangles:
            problem = meshopt_decodeIndexBuffer(out.data(), view.count, view.stride, in, size);
            break;
        case MeshoptView::Mode::indices:
            problem = meshopt_decodeIndexSequence(out.data(), view.count, view.stride, in, size);
            break;
    }
    if (problem == -1) return "it is no meshopt data of a version that libmeshoptimizer reads";
    if (problem != 0) return "its meshopt data are damaged";
    switch (view.filter) {
        case MeshoptView::Filter::none:
            break;
        case MeshoptView::Filter::octahedral:
            meshopt_decodeFilterOct(out.data(), view.count, view.stride);
            break;
        case MeshoptView::Filter::quaternion:
            meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
            break;
        case MeshoptView::Filter::exponential:
            meshopt_decodeFilterExp(out.data(), view.count, view.stride);
            break;
    }
    return nullptr;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* rtsg_unpack_meshopt_1(const MeshoptView& view,
                                                                                    std::string& out) {
    try {
        return unpack(view, out);
    } catch (const std::bad_alloc&) {
        return "it takes more memory than there is";
    }
}
