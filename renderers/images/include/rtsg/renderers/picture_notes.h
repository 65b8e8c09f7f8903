// Notes of pictures: texts that a .png or an .exr holds beside its pixels, such as what the picture was made of.
//
// Damage is not judged here: what reads the pixels finds it. Threading: pure functions. Source: W3C, Portable Network
// Graphics (third edition), 11.3.3.4 (iTXt); "OpenEXR File Layout" (openexr.com).
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <rtsg/core/diagnostic.h>

namespace rtsg {

/// By name; Picture::notes.
using PictureNotes = std::vector<std::pair<std::string, std::string>>;

/// The notes of a .png or .exr; of other files none. Error: it cannot be read.
Result<PictureNotes> readPictureNotes(const std::filesystem::path& file);

}  // namespace rtsg
