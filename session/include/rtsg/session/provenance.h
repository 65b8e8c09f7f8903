// Provenance: what a picture or a stretch of sound was made of, as its file says it, so that `assemble` joins only what
// belongs together.
//
// Pictures in a row and tiles of pictures carry it as notes, stretches of sound as their comment. Two of them belong
// together if session, options and version are the same, and for tiles of one picture the state, too. Threading: pure
// functions.
#pragma once

#include <string>

#include <rtsg/renderers/image.h>
#include <rtsg/renderers/light_renderer.h>
#include <rtsg/renderers/picture_notes.h>

namespace rtsg {

struct Provenance {
    std::string session;  // of the log, or the hash of the first state of a scene that ran here
    std::string options;  // "name=value" by commas
    std::string state;    // number and hash
    std::string version;  // of the program

    /// Made by this program.
    static Provenance ofHere(std::string session, std::string options, std::string state);
    static Provenance of(const PictureNotes& notes);
    /// Of the comment of a stretch, as comment() writes it.
    static Provenance of(const std::string& comment);
    PictureNotes notes() const;
    std::string comment() const;
    bool empty() const { return session.empty() && options.empty() && state.empty() && version.empty(); }
};

/// What two pictures of one state must have in common to be the same, as "name=value" by commas.
std::string pictureSettings(const ImageOptions& image, const ToneMap& toneMap, const TessellationError& tessellation);

/// Checks that what was made of `other` belongs to what was made of `first`, and says what differs.
Result<> belongsTogether(const Provenance& other, const std::string& file, const Provenance& first,
                         const std::string& firstFile);
/// The same for tiles of one picture.
Result<> isOneState(const Provenance& other, const std::string& file, const Provenance& first,
                    const std::string& firstFile);

}  // namespace rtsg
