// Reading whole files: encoding detection, gzip, SceneBuilder, Inlines and EXTERNPROTOs.
//
// Threading: one thread, which may have others help it with long lists. Never throws for bad input: it is in the
// diagnostics, with positions. Source: RTSG paper 3.1.

// Example:
//     #include <rtsg/core/loader.h>
//     rtsg::Scene scene;
//     rtsg::Diagnostics diagnostics{"hall.x3dv"};
//     const bool loaded = rtsg::loadFile(scene, "hall.x3dv", diagnostics);
//     for (const rtsg::Diagnostic& d : diagnostics.all())
//         std::cerr << d.format() << '\n';  // hall.x3dv:12:5: warning: ...
//     if (loaded) scene.newFrame(0);
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <rtsg/core/document_handler.h>
#include <rtsg/core/resource.h>
#include <rtsg/core/scene.h>

namespace rtsg {

/// Reports bytes read of bytes in all; for progress bars.
using Progress = std::function<void(std::uint64_t done, std::uint64_t total)>;

/// Detects the encoding from the content (after gunzip), never from the name alone.
Encoding detectEncoding(std::string_view head);

struct ReadOptions {
    Progress progress{};
    /// How many threads read a list of numbers that is more than 4 MiB of text, 0: one a core; of more than 8, 8 do.
    /// What comes out is the same. The handler, the diagnostics and the progress are called by the caller's thread
    /// alone.
    unsigned threads = 0;
    bool headerless = false;  // ClassicVRML may come without its header's line
};

/// Parses one document, already in memory and unpacked, into commands. The view must stay valid during the call.
/// Returns false if the document was so broken that reading stopped early; what was read before has been pushed.
bool readDocument(std::string_view text, DocumentHandler& handler, Diagnostics& diagnostics,
                  const ReadOptions& options = {});
/// Same for a file, plain or gzip; "-" is standard input.
bool readDocumentFile(const std::filesystem::path& file, DocumentHandler& handler, Diagnostics& diagnostics,
                      const ReadOptions& options = {});

/// From now on prototypes and scripts of the scene can be made of documents (document_services.h). Whatever loads a
/// document calls it; who goes on with a session of a log or a mirror, without one, does so too.
void registerDocuments(Scene& scene);

struct LoadOptions {
    bool loadInlines = true;
    std::optional<Resources> resources;  // none given: of loadFile Resources::ofFile(file), of loadText Resources(base)
    Progress progress;
    unsigned threads = 0;  // as ReadOptions
};

/// Reads a file into a scene (appending to what is there). False if nothing usable was in it.
bool loadFile(Scene& scene, const std::filesystem::path& file, Diagnostics& diagnostics,
              const LoadOptions& options = {});
/// Reads text; `base` is the folder that relative urls start from.
bool loadText(Scene& scene, std::string_view text, Diagnostics& diagnostics, const std::filesystem::path& base = {},
              const LoadOptions& options = {});

}  // namespace rtsg
