// mediaSeconds: how long a sound or a film is, for whatever loads a document (BuildOptions::mediaLength).
//
// Threading: any thread.
#pragma once

#include <cstdint>
#include <optional>

#include <rtsg/core/resource.h>

namespace rtsg {

/// In seconds, by the file's head where that tells; a sound that is packed like a film without pictures is decoded for
/// it, up to `maximumSamples`. Nothing: it is neither, or cannot be read.
std::optional<double> mediaSeconds(const Resource& file, std::uint64_t maximumSamples);

}  // namespace rtsg
