// Reading whole files: encoding detection, gzip, SceneBuilder, Inlines and EXTERNPROTOs.
//
// Threading: one thread, which may use others for long lists. Bad input never throws; the diagnostics have it, with
// positions. Source: RTSG paper 3.1.

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

/// Lets prototypes and scripts of the scene be made of documents from now on (document_services.h). Functions that load
/// a document call it. Call it yourself if you continue a session of a log or a mirror without loading a document.
void registerDocuments(Scene& scene);
/// The same, with formats and node types of the application for all that the scene reads and writes; null: none.
void registerDocuments(Scene& scene, std::shared_ptr<const Dialect> dialect);
/// That dialect, with the custom node types that the scene itself has; null if there are neither. Valid as long as the
/// scene.
std::shared_ptr<const Dialect> dialectOf(const Scene& scene);

struct LoadOptions {
    bool loadInlines = true;
    std::optional<Resources> resources;  // the default is Resources::ofFile(file) in loadFile, and Resources(base) in
                                         // loadText
    Progress progress;
    unsigned threads = 0;     // as in ReadOptions
    bool namedByUrl = false;  // as in BuildOptions
    std::string clip{};       // as in ReadOptions
};

/// Reads a file and appends its nodes to the scene. Returns false if the file has nothing usable.
bool loadFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
              const LoadOptions& options = {});
/// Reads text; `base` is the folder that relative urls start from.
bool loadText(Scene& scene, std::string_view text, Diagnostics& diagnostics, const std::filesystem::path& base = {},
              const LoadOptions& options = {});

}  // namespace rtsg
