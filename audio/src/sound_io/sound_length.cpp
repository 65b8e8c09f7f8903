// Reads the headers of uncompressed sound files, as far as needed to know how long they should be.
#include "sound_length.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include <rtsg/core/machine.h>

namespace rtsg {
namespace {

/// How the parts of a file are laid out.
struct Layout {
    bool bigEndian = false;
    std::int64_t name = 4, size = 4;  // bytes
    std::int64_t counted = 0;         // of name and size, in the size
    std::int64_t aligned = 2;
    std::string_view sound = "data";
    std::int64_t before = 0;  // bytes of that part that come before the sound
};

std::uint64_t number(std::string_view bytes, bool bigEndian) {
    std::uint64_t result = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i)
        result = result << 8 | static_cast<unsigned char>(bytes[bigEndian ? i : bytes.size() - 1 - i]);
    return result;
}

/// The part of a file that holds samples: the bytes that its size promises, and where it begins.
struct Sound {
    std::uint64_t promised = 0;
    std::int64_t begin = 0;
};

Sound findSound(const SoundBytes& file, const Layout& layout, std::int64_t at) {
    constexpr int kMaxParts = 1000;
    std::uint64_t longSize = 0;  // of RF64
    for (int part = 0; part < kMaxParts; ++part) {
        const std::string head = file.part(at, layout.name + layout.size);
        if (static_cast<std::int64_t>(head.size()) < layout.name + layout.size) break;
        const std::string_view name = std::string_view(head).substr(0, 4);
        std::uint64_t size =
            number(std::string_view(head).substr(static_cast<std::size_t>(layout.name)), layout.bigEndian);
        const std::int64_t begin = at + layout.name + layout.size;
        if (name == "ds64") longSize = number(file.part(begin + 8, 8), false);
        if (name == layout.sound) {
            if (longSize > 0 && size == 0xffffffff) size = longSize;
            const auto before = static_cast<std::uint64_t>(layout.counted + layout.before);
            return {size > before ? size - before : 0, begin + layout.before};
        }
        const auto left = static_cast<std::uint64_t>(file.size - begin + layout.counted);
        if (size > left || size < static_cast<std::uint64_t>(layout.counted)) break;
        const auto whole = static_cast<std::int64_t>(size) - layout.counted;
        at = begin + (whole + layout.aligned - 1) / layout.aligned * layout.aligned;
    }
    return {};
}

Sound soundIn(const SoundBytes& file) {
    const std::string start = file.part(0, 16);
    const std::string_view name = std::string_view(start).substr(0, 4);
    if (name == "RIFF" || name == "RF64") return findSound(file, {}, 12);
    if (name == "RIFX") return findSound(file, {.bigEndian = true}, 12);
    if (name == "FORM") return findSound(file, {.bigEndian = true, .sound = "SSND", .before = 8}, 12);
    // Names of 16 bytes, which begin with the usual four, in small letters.
    if (name == "riff") return findSound(file, {.name = 16, .size = 8, .counted = 24, .aligned = 8}, 40);
    if ((name == ".snd" || name == "dns.") && start.size() >= 12) {
        const bool big = name == ".snd";
        return {number(std::string_view(start).substr(8, 4), big),
                static_cast<std::int64_t>(number(std::string_view(start).substr(4, 4), big))};
    }
    return {};
}

}  // namespace

double promisedFraction(const SoundBytes& file) {
    // Who writes into a pipe gives a size that no such file has. Some programs count their header in.
    constexpr std::uint64_t kUnknown = 0x7fff0000, kHeader = 64;
    const Sound sound = soundIn(file);
    const std::int64_t there = file.size - sound.begin;
    if (there <= 0 || sound.promised <= static_cast<std::uint64_t>(there) + kHeader) return 1;
    if (sound.promised >= kUnknown && sound.promised <= 0xffffffff) return 1;
    return static_cast<double>(sound.promised) / static_cast<double>(there);
}

std::string missingSound(double promised, const SoundBuffer& sound, double tolerated) {
    if (!(promised - tolerated > static_cast<double>(sound.frames()))) return {};
    return fmt::format("{:.3g} s of the {:.3g} s that its header gives can be read", sound.seconds(),
                       promised / sound.sampleRate);
}

std::string unreadableFrom(const SoundBuffer& sound) {
    return fmt::format("it cannot be read further than {:.3g} s", sound.seconds());
}

std::unexpected<Diagnostic> tooManySamples(std::uint64_t maxSamples) {
    return fail(fmt::format("more than {} samples; --limit samples=N raises this", maxSamples));
}

Result<> makeRoom(SoundBuffer& sound, std::size_t more) {
    const std::size_t wanted = sound.samples.size() + more;
    if (wanted > sound.samples.capacity()) {
        // Growing copies the content.
        const std::size_t grown = std::max(wanted, 2 * sound.samples.size());
        if (auto ok = mayHold(grown * sizeof(float)); !ok) return ok;
        sound.samples.reserve(grown);
    }
    sound.samples.resize(wanted);
    return {};
}

}  // namespace rtsg
