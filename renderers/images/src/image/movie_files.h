// MovieFiles: the pictures of films, by a module (librtsg_movies.so) that is loaded when the first film is shown or
// made.
//
// Where there is a sandbox, films are read in workers of it; they are made here.
// Invariant: nothing of FFmpeg is on this side; the module links nothing of ours, opens nothing but the bytes it is
// given and writes nothing but through what it is given. Errors are sentences; an empty one means done. Threading:
// open() and make() from any thread; one film on one thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <rtsg/core/diagnostic.h>

#include "image/image_files.h"

namespace rtsg {

class Resource;

struct MovieBytes {
    std::uint64_t size = 0;
    /// Fills `to` with the bytes from `offset` on, as far as the file goes; returns their number.
    std::function<std::size_t(std::uint64_t offset, std::span<std::uint8_t> to)> read;
    /// Asked before memory is taken for a picture; not set: there is enough.
    std::function<bool(std::uint64_t bytes)> mayTake{};
};

class MovieFile {
  public:
    virtual ~MovieFile() = default;
    /// How long its pictures are shown.
    virtual double seconds() const = 0;
    /// The picture that is shown `time` seconds after the first one began, bottom row first, 3 or 4 channels; the last
    /// one for all later times. If it is the same as in the call before, leaves `out` alone and clears `changed`.
    virtual std::string frameAt(double time, bool& changed, FilePixels& out) = 0;
};

/// The sound of a film from its first picture to the end of its last; of a file without pictures, the whole sound.
struct FileSound {
    int sampleRate = 0, channels = 0;
    std::vector<float> samples;  // interleaved
    bool known = false;          // the file is of a format that is read, whatever becomes of its sound
};

/// The destination of a film that is made.
struct MovieSink {
    /// Writes at any offset, also before bytes that were written already; false if that failed.
    std::function<bool(std::uint64_t offset, std::span<const std::uint8_t> bytes)> write;
};

struct FilmShape {
    int width = 0, height = 0;  // pixels
    double picturesPerSecond = 0;
    bool hasSound = false;  // sound() will be called: encoded pictures are kept until finish()
};

class MovieMaker {
  public:
    virtual ~MovieMaker() = default;
    /// The next picture: RGBA, top row first; alpha is not looked at.
    virtual std::string add(std::span<const std::uint8_t> rgba) = 0;
    /// The last picture once more.
    virtual std::string repeat() = 0;
    /// Adds the sound of one or two channels, from the beginning of the first picture on. Call it at most once, for a
    /// film with sound.
    virtual std::string sound(const FileSound& sound) = 0;
    virtual std::string finish() = 0;
};

class MovieFiles {
  public:
    virtual ~MovieFiles() = default;
    /// An MP4 of H.264 and AAC, with the same bytes each time, whatever the number of cores.
    virtual std::string make(MovieSink sink, const FilmShape& shape, std::unique_ptr<MovieMaker>& out) const = 0;
    /// Refuses pictures of more pixels than `maximumPixels`.
    virtual std::string open(MovieBytes bytes, std::uint64_t maximumPixels, std::unique_ptr<MovieFile>& out) const = 0;
    /// Refuses more than `maximumSamples`, all channels counted.
    virtual std::string readSound(MovieBytes bytes, std::uint64_t maximumSamples, FileSound& out) const = 0;
};

/// Those of the sandbox if isSandboxed(), otherwise those of this process.
Result<const MovieFiles*> movieFiles();
/// Loads the module, as imageFiles() does.
Result<const MovieFiles*> movieFilesHere();

/// The pictures of a film, which keeps the file. Errors: as for Movie::open().
Result<std::unique_ptr<MovieFile>> openMovie(const std::shared_ptr<const Resource>& file, std::uint64_t maximumPixels);

/// The name that the module exports; it changes whenever this header does.
#define RTSG_MOVIE_FILES_SYMBOL rtsgMovieFiles6

}  // namespace rtsg
