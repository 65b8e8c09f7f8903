#include <map>
#include <memory>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/renderers/mesh.h>
#include <rtsg/renderers/shared_world.h>

#include "cli.h"

namespace rtsg::app {

namespace {

struct Counts {
    std::size_t nodes = 0, protos = 0, scripts = 0, sounds = 0, instances = 0, triangles = 0;
    std::map<std::string, std::size_t> components;
};

Counts count(const Scene& scene) {
    Counts c;
    scene.forEachNode([&](const Node& node) {
        if (node.id() == scene.root()) return;
        ++c.nodes;
        const NodeType& type = node.type();
        if (type.isA("X3DScriptNode")) ++c.scripts;
        if (type.name == "Sound" || type.name == "SpatialSound") ++c.sounds;
        if (type.kind == NodeType::Kind::builtin) ++c.components[type.component];
    });
    for (std::size_t i = builtinTypes().size(); i < scene.typeCount(); ++i) {
        const auto kind = scene.type(TypeIndex{static_cast<std::uint16_t>(i)}).kind;
        if (kind == NodeType::Kind::proto || kind == NodeType::Kind::externProto) ++c.protos;
    }
    return c;
}

}  // namespace

Verb addInfo(CLI::App& program) {
    struct Options {
        std::string scene;
        ResourceArguments resources;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command = program.add_subcommand("info", "Count nodes, triangles, routes and sounds; list components");
    command->add_option("SCENE", options->scene, "scene file, or -")->required();
    options->resources.addTo(*command);
    command->add_flag("--json", options->json, "one JSON object");
    command->footer("Example: rtsg info --json hall.x3dv");
    return {command, [options] {
                Scene scene;
                Diagnostics diagnostics(options->scene);
                const bool ok = load(scene, options->scene, diagnostics, options->resources.ofFile(options->scene));
                const SharedWorld world(scene);  // no rays are asked for: no BVH is built
                Counts c = count(scene);
                const InstanceDelta all = world.flattener().snapshot();
                std::map<NodeId, std::size_t> triangles;
                for (const auto& geometry : all.geometries)
                    if (geometry.mesh) triangles[geometry.node] = geometry.mesh->triangleCount;
                for (const Instance& instance : all.added) {
                    ++c.instances;
                    c.triangles += triangles[instance.geometry];
                }
                const auto& root = scene.node(scene.root());
                const std::string profile = root.get(x3d::RtsgScene::profile).str();
                if (options->json) {
                    std::string components;
                    for (const auto& [name, n] : c.components)
                        components += fmt::format("{}{}:{}", components.empty() ? "" : ",", jsonString(name), n);
                    fmt::print(
                        "{{\"nodes\":{},\"routes\":{},\"triangles\":{},\"instances\":{},\"protos\":{},\"scripts\":{},"
                        "\"sounds\":{},\"profile\":{},\"components\":{{{}}},\"errors\":{},\"warnings\":{}}}\n",
                        c.nodes, scene.routeCount(), c.triangles, c.instances, c.protos, c.scripts, c.sounds,
                        jsonString(profile), components, diagnostics.errors(), diagnostics.warnings());
                } else {
                    fmt::print(
                        "{}\n  profile    {}\n  nodes      {}\n  routes     {}\n  shapes     {}\n  triangles  {}\n"
                        "  protos     {}\n  scripts    {}\n  sounds     {}\n  problems   {} errors, {} warnings\n",
                        options->scene, profile.empty() ? "none named" : profile, c.nodes, scene.routeCount(),
                        c.instances, c.triangles, c.protos, c.scripts, c.sounds, diagnostics.errors(),
                        diagnostics.warnings());
                    fmt::print("  components\n");
                    for (const auto& [name, n] : c.components) fmt::print("    {:<24} {:>7} nodes\n", name, n);
                }
                return ok ? kDone : kBad;
            }};
}

Verb addValidate(CLI::App& program) {
    struct Options {
        std::vector<std::string> files;
        ResourceArguments resources;
        bool json = false;
    };
    auto options = std::make_shared<Options>();
    CLI::App* command = program.add_subcommand("validate", "Print errors and warnings with positions");
    command->add_option("FILE", options->files, "scene files")->required();
    options->resources.addTo(*command);
    command->add_flag("--json", options->json, "one JSON object a file");
    command->footer("Example: rtsg validate models/*.x3d\nExit status 1 if any file has an error.");
    return {command, [options] {
                bool good = true;
                for (const std::string& file : options->files) {
                    Scene scene;
                    Diagnostics diagnostics(file);
                    const bool ok =
                        load(scene, file, diagnostics, options->resources.ofFile(file)) && diagnostics.errors() == 0;
                    good = good && ok;
                    if (options->json)
                        fmt::print("{{\"file\":{},\"errors\":{},\"warnings\":{}}}\n", jsonString(file),
                                   diagnostics.errors(), diagnostics.warnings());
                    else
                        fmt::print("{}: {} errors, {} warnings\n", file, diagnostics.errors(), diagnostics.warnings());
                }
                return good ? kDone : kBad;
            }};
}

}  // namespace rtsg::app
