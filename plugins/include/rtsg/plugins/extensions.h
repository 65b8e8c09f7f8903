// Extensions: additions to a program without building it again: node types and their behaviour, file formats, and node
// renderers. Plug-ins and node tables add them; scenes, worlds and renderers use them.
//
// A plug-in (plugin.h) is loaded only if the user names it, never because a file, a log or a peer does. Its code runs
// with all rights of the program. Threading: fill it on one thread, before scenes use it; after that it is constant,
// and its functions are called as the registry that they are added to says. Source: RTSG paper 3.1, 4.1.1 (loaded and
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

/// Makes a subscriber for a scene that runs; null: no subscriber for this scene.
using SubscriberMaker = std::function<std::unique_ptr<Subscriber>(Scene& scene)>;

class Extensions {
  public:
    // ---- additions of a plug-in: later ones are asked first, and all of them before built-in ones ----
    /// A reader or writer that lacks a function is not added; added() returns the error.
    void add(FormatReader reader);
    void add(FormatWriter writer);
    /// Errors: there is another type of that name; it is null, or not finished (NodeType::finish).
    Result<> add(std::shared_ptr<const NodeType> type);
    /// Adds all types of a table that rtsg_node_table has compiled: `extensions.add(workshop::nodeTypes())`.
    Result<> add(std::vector<std::unique_ptr<NodeType>> types);
    /// Adds a field type for tables, files and nodes, which stays known to the process. Errors: those of
    /// registerFieldType.
    Result<std::shared_ptr<const CustomType>> addFieldType(std::string_view name, CustomLayout layout,
                                                           CustomFunctions functions = {});
    /// Sets the behaviour of nodes of the type. It must not throw.
    void addBehaviour(std::string type, const Behaviour& behaviour);
    /// Sets the source of triangles of a geometry type, which may be a built-in type.
    void addMeshSource(std::string type, MeshSource source);
    /// Sets how renderers of class R render nodes of the type, instead of their own way:
    /// `extensions.addNodeRenderer<LightRenderer>("Pane", nodeRendererFor<LightRenderer>(...))`.
    template <class R>
    void addNodeRenderer(std::string type, NodeRenderer renderer) {
        nodeRenderers_.push_back([type = std::move(type), renderer = std::move(renderer)](Renderer& one) {
            const bool suits = dynamic_cast<R*>(&one);
            if (suits) one.registerNodeRenderer(type, renderer);
            return suits;
        });
    }
    /// Adds a subscriber to each scene that a program runs.
    void addSubscriber(SubscriberMaker maker) { subscribers_.push_back(std::move(maker)); }

    // ---- use by a program ----
    /// Formats and node types; null if there are none. A later add() does not change the object.
    std::shared_ptr<const Dialect> dialect() const { return dialect_; }
    /// Registers with a scene: it can read and write the formats, its files may use the node types, and its nodes act.
    void registerWith(Scene& scene) const;
    void registerWith(SharedWorld& world) const;
    /// Registers mesh sources with a flattener that has no world, such as that of mesh files.
    void registerWith(Flattener& flattener, const Scene& scene) const;
    /// Returns whether the renderer has got node renderers.
    bool registerWith(Renderer& renderer) const;

    /// The subscribers of one scene; they follow it until this object is destroyed. The scene must outlive it.
    class Attached {
      public:
        std::size_t count() const { return all_.size(); }

      private:
        friend class Extensions;
        std::vector<std::pair<std::unique_ptr<Subscriber>, Attachment>> all_;
    };
    /// Errors: a maker throws. The other subscribers are attached in any case, and the first error is returned.
    Result<> attachSubscribers(Scene& scene, Attached& attached) const;

    /// The first error of the add() functions; loadPlugin() returns it for a plug-in.
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

/// Loads a plug-in, and adds its extensions. It stays loaded until the process ends. Errors, each with the file's name:
/// no such file; no plug-in; other headers, and then nothing of it runs; no shared library, or one with missing
/// symbols; an exception or error of the plug-in.
Result<> loadPlugin(const std::filesystem::path& file, Extensions& extensions);

/// Adds the node types of a table (.x3dspec), which may inherit from the standard's types. Errors of the table go to
/// `diagnostics`, with positions; then it returns false and adds nothing.
bool loadNodeTable(const std::filesystem::path& file, Extensions& extensions, Diagnostics& diagnostics);
/// The same for a text; `diagnostics` has its name.
bool readNodeTable(std::string_view text, Extensions& extensions, Diagnostics& diagnostics);

}  // namespace rtsg
