// Plug-ins that are not as they should be: which one is said when it is compiled.
#ifdef ODD_LIBRARY
#define _GLIBCXX_DEBUG
#endif
#include <cstdlib>
#include <stdexcept>

#include <rtsg/documents/filter.h>
#include <rtsg/plugins/plugin.h>
#ifdef ODD_READER
#include <rtsg/renderers/light_renderer.h>
#endif

namespace {

[[maybe_unused]] rtsg::Result<> addNothing(rtsg::Extensions&) {
    return {};
}

/// A reader whose commands break every rule.
[[maybe_unused]] bool readNonsense(rtsg::FormatSource& source, rtsg::DocumentHandler& handler, rtsg::Diagnostics&) {
    using rtsg::Value;
    handler.endNode({});
    handler.setField("point", Value(true), {});
    handler.beginNode("Shape", "a\tname", {}, {});
    handler.beginNode("Box", {}, "geometry", {});
    handler.endNode({});
    handler.endNode({});
    handler.beginNode("Shape", "KEPT", {}, {});
    handler.beginNode("Sphere", {}, "geometry", {});
    handler.setField("radius", Value(rtsg::Vec3f(1)), {});
    handler.setField("radius", Value(std::numeric_limits<float>::quiet_NaN()), {});
    handler.setField("size", Value(1.0f), {});
    handler.endProto({});
    handler.endDocument();
    handler.beginNode("Box", {}, {}, {});
    if (source.bytes().contains("throw")) throw std::runtime_error("out of ideas");
    return true;
}

/// A writer that gives up after some nodes.
class Tired final : public rtsg::Filter {
  public:
    void beginNode(std::string_view, std::string_view, std::string_view, rtsg::SourceLocation) override {
        throw std::runtime_error("too many nodes");
    }
};

}  // namespace

#if defined ODD_HEADERS
// As earlier headers have it: it would need what is no longer there, and what runs first would end the program.
#undef RTSG_PLUGIN_HEADERS
#define RTSG_PLUGIN_HEADERS "0.2-0123456789ab"
namespace rtsg {
void whatNobodyHas();
}
[[maybe_unused]] const int kFirst = (std::_Exit(70), 0);
RTSG_PLUGIN(extensions) {
    (void)extensions;
    rtsg::whatNobodyHas();
    return {};
}
#elif defined ODD_NOTHING
[[gnu::used]] const char kSays[] = RTSG_PLUGIN_INTERFACE;
extern "C" const rtsg::PluginEntry* rtsg_plugin() {
    return nullptr;
}
#elif defined ODD_FUNCTION
[[gnu::used]] const char kSays[] = RTSG_PLUGIN_INTERFACE;
extern "C" int rtsg_other() {
    return 1;
}
#elif defined ODD_SAYS
extern "C" const rtsg::PluginEntry* rtsg_plugin() {
    std::_Exit(70);
}
#elif defined ODD_LIBRARY
RTSG_PLUGIN(extensions) {
    return addNothing(extensions);
}
#elif defined ODD_SYMBOL
namespace rtsg {
void whatNobodyHas();
}
RTSG_PLUGIN(extensions) {
    (void)extensions;
    rtsg::whatNobodyHas();
    return {};
}
#elif defined ODD_THROWS
RTSG_PLUGIN(extensions) {
    if (const auto type = extensions.addFieldType("SFUnpaid", {}); !type) return std::unexpected(type.error());
    extensions.add(rtsg::FormatReader{
        .name = "half", .recognises = [](const rtsg::FormatClue&) { return true; }, .read = readNonsense});
    throw std::runtime_error("no licence");
}
#elif defined ODD_INCOMPLETE
RTSG_PLUGIN(extensions) {
    rtsg::FormatReader reader;
    reader.name = "empty";
    extensions.add(std::move(reader));
    return {};
}
#elif defined ODD_UNFINISHED
RTSG_PLUGIN(extensions) {
    auto type = std::make_unique<rtsg::NodeType>();
    type->name = "Half";
    type->fields.emplace_back();
    return extensions.add(std::shared_ptr<const rtsg::NodeType>(std::move(type)));
}
#elif defined ODD_ERROR
RTSG_PLUGIN(extensions) {
    auto box = std::make_unique<rtsg::NodeType>();
    box->name = "Box";
    return extensions.add(std::shared_ptr<const rtsg::NodeType>(std::move(box)));
}
#else
RTSG_PLUGIN(extensions) {
    extensions.add(
        rtsg::FormatReader{.name = "nonsense",
                           .recognises = [](const rtsg::FormatClue& clue) { return clue.head.starts_with("nonsense"); },
                           .read = readNonsense});
    extensions.add(rtsg::FormatReader{
        .name = "unsure", .recognises = [](const rtsg::FormatClue&) -> bool { throw 1; }, .read = readNonsense});
    extensions.add(
        rtsg::FormatWriter{.name = "tired", .extensions = {".tired"}, .make = [](rtsg::TextSink, rtsg::Diagnostics&) {
                               return std::make_unique<Tired>();
                           }});
    extensions.addSubscriber(
        [](rtsg::Scene&) -> std::unique_ptr<rtsg::Subscriber> { throw std::runtime_error("busy"); });
    extensions.addMeshSource("Cone", [](const rtsg::Scene&, rtsg::NodeId) -> std::shared_ptr<const rtsg::Mesh> {
        throw std::runtime_error("out of triangles");
    });
    extensions.addNodeRenderer<rtsg::LightRenderer>(
        "Cylinder",
        rtsg::nodeRendererFor<rtsg::LightRenderer>([](rtsg::LightRenderer& light, const rtsg::Node&, rtsg::Operation) {
            light.frame().pixels.clear();
            return rtsg::Result<>();
        }));
    return {};
}
#endif
