// Reading whole files: encoding detection, gzip, SceneBuilder, Inlines and EXTERNPROTOs.
//
// Threading: one thread, which may have others help it with long lists. Never throws for bad input: it is in the
// diagnostics, with positions. Source: RTSG paper 3.1.

// Example:
//     #include <rtsg/documents/loader.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics{"hall.x3dv"};
//     const bool loaded = rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     for (const rtsg::Diagnostic& d : diagnostics.all())
//         std::cerr << d.format() << '\n';  // hall.x3dv:12:5: warning: ...
//     if (loaded) scene.newFrame(0);
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>
#include <rtsg/documents/read_document.h>

namespace rtsg {

/// From now on prototypes and scripts of the scene can be made of documents (document_services.h). Whatever loads a
/// document calls it; who goes on with a session of a log or a mirror, without one, does so too.
void registerDocuments(Scene& scene);
/// The same, with formats and node types of one's own for all that the scene reads and writes from now on; null: none.
void registerDocuments(Scene& scene, std::shared_ptr<const Dialect> dialect);
/// That, and the node types that the scene itself has of users' tables; null if there are neither. Valid as long as the
/// scene.
std::shared_ptr<const Dialect> dialectOf(const Scene& scene);

struct LoadOptions {
    bool loadInlines = true;
    std::optional<Resources> resources;  // none given: of loadFile Resources::ofFile(file), of loadText Resources(base)
    Progress progress;
    unsigned threads = 0;     // as ReadOptions
    bool namedByUrl = false;  // as BuildOptions
    std::string clip{};       // as ReadOptions
};

/// Reads a file into a scene, and appends to its content. False if the file has nothing usable.
bool loadFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
              const LoadOptions& options = {});
/// Reads text; `base` is the folder that relative urls start from.
bool loadText(Scene& scene, std::string_view text, Diagnostics& diagnostics, const std::filesystem::path& base = {},
              const LoadOptions& options = {});

}  // namespace rtsg
