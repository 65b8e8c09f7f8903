// Extensions: what is added to a program without building it anew: node types with what they do, formats of files, and
// what renderers make of nodes. Plug-ins and node tables fill it; scenes, worlds and renderers take it.
//
// A plug-in (plugin.h) is loaded because the user of a program names it, never because a file, a log or a peer does.
// Its code runs with all the rights of the program. Threading: fill it on one thread, before scenes take it; what it
// holds is then constant, and called as the registry says that it goes to. Source: RTSG paper 3.1, 4.1.1 (loaded and
// registered at run time).

// Example:
//     #include <rtsg/plugins/extensions.h>
//     rtsg::Extensions extensions;
//     if (auto ok = rtsg::loadPlugin("my_plugin.so", extensions); !ok) std::cerr << ok.error().format() << '\n';
//     rtsg::Scene scene;
//     extensions.registerWith(scene);
//     rtsg::Diagnostics diagnostics;
//     rtsg::loadFile(scene, "own.x3dv", diagnostics);
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/behaviour.h>
#include <rtsg/documents/dialect.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/renderer.h>
#include <rtsg/renderers/shared_world.h>

namespace rtsg {

/// Makes a subscriber for a scene that runs; null: none for this one.
using SubscriberMaker = std::function<std::unique_ptr<Subscriber>(Scene& scene)>;

class Extensions {
  public:
    // ---- what a plug-in adds. What comes later is asked first, and all of it before what is built in.
    // -----------------
    /// One that lacks a function is not added, and added() says so.
    void add(FormatReader reader);
    void add(FormatWriter writer);
    /// Errors: there is another type of that name; it is null, or not finished (NodeType::finish).
    Result<> add(std::shared_ptr<const NodeType> type);
    /// All of a table that rtsg_node_table has compiled: `extensions.add(workshop::nodeTypes())`.
    Result<> add(std::vector<std::unique_ptr<NodeType>> types);
    /// A field type for tables, files and nodes, which stays known to the process. Errors: those of registerFieldType.
    Result<std::shared_ptr<const CustomType>> addFieldType(std::string_view name, CustomLayout layout,
                                                           CustomFunctions functions = {});
    /// What nodes of the type do. It must not throw.
    void addBehaviour(std::string type, const Behaviour& behaviour);
    /// The triangles of a geometry node, also in the place of a built-in type's.
    void addMeshSource(std::string type, MeshSource source);
    /// What renderers of class R make of nodes of the type, in the place of what they make of them themselves:
    /// `extensions.addNodeRenderer<LightRenderer>("Pane", nodeRendererFor<LightRenderer>(...))`.
    template <class R>
    void addNodeRenderer(std::string type, NodeRenderer renderer) {
        nodeRenderers_.push_back([type = std::move(type), renderer = std::move(renderer)](Renderer& one) {
            const bool suits = dynamic_cast<R*>(&one);
            if (suits) one.registerNodeRenderer(type, renderer);
            return suits;
        });
    }
    /// Follows each scene that a program runs.
    void addSubscriber(SubscriberMaker maker) { subscribers_.push_back(std::move(maker)); }

    // ---- what a program does with it
    // ----------------------------------------------------------------------------------
    /// Formats and node types; null if there are none. A later add() does not change it.
    std::shared_ptr<const Dialect> dialect() const { return dialect_; }
    /// The scene reads and writes the formats, files in it may name the node types, and its nodes act.
    void registerWith(Scene& scene) const;
    void registerWith(SharedWorld& world) const;
    /// For who flattens a scene without a world, as mesh files do.
    void registerWith(Flattener& flattener, const Scene& scene) const;
    /// Whether it has node renderers of its own now.
    bool registerWith(Renderer& renderer) const;

    /// The subscribers of one scene, which they follow until this is destroyed. The scene must outlive it.
    class Attached {
      public:
        std::size_t count() const { return all_.size(); }

      private:
        friend class Extensions;
        std::vector<std::pair<std::unique_ptr<Subscriber>, Attachment>> all_;
    };
    /// Errors: a maker throws; the others are there in any case, and the first error is told.
    Result<> attachSubscribers(Scene& scene, Attached& attached) const;

    /// The first error of what was added, whether anybody has looked at it or not; of a plug-in loadPlugin() does.
    const Result<>& added() const { return added_; }

  private:
    Result<> note(Result<> added);

    std::shared_ptr<const Dialect> dialect_;
    std::vector<std::pair<std::string, Behaviour>> behaviours_;
    std::vector<std::pair<std::string, MeshSource>> meshSources_;
    std::vector<std::function<bool(Renderer&)>> nodeRenderers_;
    std::vector<SubscriberMaker> subscribers_;
    Result<> added_;  // the first error of add()
};

/// Loads a plug-in, and adds what it has. It stays loaded until the process ends. Errors, each with the file's name: no
/// such file; no plug-in; one that was compiled with other headers, of which nothing runs; no shared library, or one
/// that lacks something; what it throws or returns.
Result<> loadPlugin(const std::filesystem::path& file, Extensions& extensions);

/// Adds the node types of a table (.x3dspec), which may inherit from the standard's types. Errors of the table go to
/// `diagnostics`, with positions; false, and nothing is added, if it has any.
bool loadNodeTable(const std::filesystem::path& file, Extensions& extensions, Diagnostics& diagnostics);
/// The same of a text; `diagnostics` has its name.
bool readNodeTable(std::string_view text, Extensions& extensions, Diagnostics& diagnostics);

}  // namespace rtsg
