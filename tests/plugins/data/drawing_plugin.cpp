// A plug-in that draws what light makes of Spheres, and makes other triangles of Boxes.
#include <rtsg/plugins/plugin.h>
#include <rtsg/renderers/light_renderer.h>

namespace {

using namespace rtsg;

Result<> drawGreen(LightRenderer& light, const Node&, Operation operation) {
    if (operation == LightRenderer::kDraw)
        for (Vec4f& pixel : light.frame().pixels) pixel = {0, 1, 0, 1};
    return {};
}

}  // namespace

RTSG_PLUGIN(extensions) {
    extensions.addNodeRenderer<LightRenderer>("Sphere", nodeRendererFor<LightRenderer>(drawGreen));
    extensions.addMeshSource("Box", [](const Scene&, NodeId) { return std::make_shared<const Mesh>(); });
    return {};
}
