// Finds ICC profiles in image files, and compares them with sRGB: its primaries, and its curve at a few places.
#include "color_profile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include <zlib.h>

namespace rtsg {

namespace {

using ByteSpan = std::span<const std::uint8_t>;

constexpr std::size_t kMaxBytes = std::size_t{1} << 24;  // of a profile

std::uint32_t big16(ByteSpan bytes, std::size_t at) {
    return std::uint32_t{bytes[at]} << 8 | bytes[at + 1];
}
std::uint32_t big32(ByteSpan bytes, std::size_t at) {
    return big16(bytes, at) << 16 | big16(bytes, at + 2);
}
bool begins(ByteSpan bytes, std::string_view with) {
    return bytes.size() >= with.size() &&
           std::equal(with.begin(), with.end(), bytes.begin(),
                      [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
}

// ---- where the profile lies ------------------------------------------------------------------------------------

std::vector<std::uint8_t> inflated(ByteSpan packed) {
    std::vector<std::uint8_t> result(std::min(kMaxBytes, 64 * packed.size() + 4096));
    uLongf length = result.size();
    if (uncompress(result.data(), &length, packed.data(), packed.size()) != Z_OK) return {};
    result.resize(length);
    return result;
}

std::vector<std::uint8_t> ofPng(ByteSpan file) {
    for (std::size_t at = 8; at + 12 <= file.size();) {
        const std::size_t length = big32(file, at);
        if (length > file.size() - at - 12) return {};
        const ByteSpan content = file.subspan(at + 8, length);
        const ByteSpan type = file.subspan(at + 4, 4);
        if (begins(type, "IDAT")) return {};
        if (begins(type, "iCCP")) {
            const auto end = std::ranges::find(content, std::uint8_t{0});  // of its name in the file
            if (content.end() - end < 2) return {};
            return inflated(ByteSpan(end + 2, content.end()));
        }
        at += 12 + length;
    }
    return {};
}

/// It comes in segments, numbered from 1.
std::vector<std::uint8_t> ofJpeg(ByteSpan file) {
    using namespace std::string_view_literals;
    constexpr std::string_view kName = "ICC_PROFILE\0"sv;
    constexpr std::uint8_t kScan = 0xDA, kApp2 = 0xE2;
    std::vector<std::uint8_t> result;
    std::uint8_t next = 1;
    for (std::size_t at = 2; at + 4 <= file.size() && file[at] == 0xFF;) {
        if (file[at + 1] == 0xFF) {  // filling
            ++at;
            continue;
        }
        const std::size_t length = big16(file, at + 2);
        if (file[at + 1] == kScan || length < 2 || length > file.size() - at - 2) break;
        const ByteSpan content = file.subspan(at + 4, length - 2);
        if (file[at + 1] == kApp2 && begins(content, kName) && content.size() >= kName.size() + 2) {
            if (content[kName.size()] != next++) return {};
            const ByteSpan part = content.subspan(kName.size() + 2);
            result.insert(result.end(), part.begin(), part.end());
        }
        at += 2 + length;
    }
    return result;
}

std::vector<std::uint8_t> ofWebp(ByteSpan file) {
    for (std::size_t at = 12; at + 8 <= file.size();) {
        const std::size_t length = std::size_t{file[at + 4]} | std::size_t{file[at + 5]} << 8 |
                                   std::size_t{file[at + 6]} << 16 | std::size_t{file[at + 7]} << 24;
        if (length > file.size() - at - 8) return {};
        const ByteSpan content = file.subspan(at + 8, length);
        if (begins(file.subspan(at), "ICCP")) return {content.begin(), content.end()};
        at += 8 + length + length % 2;
    }
    return {};
}

std::vector<std::uint8_t> profileIn(ByteSpan file) {
    if (begins(file, "\x89PNG")) return ofPng(file);
    if (begins(file, "\xFF\xD8\xFF")) return ofJpeg(file);
    if (begins(file, "RIFF") && file.size() >= 12 && begins(file.subspan(8), "WEBP")) return ofWebp(file);
    return {};
}

// ---- what it says ----------------------------------------------------------------------------------------------

class Profile {
  public:
    static constexpr std::size_t kHead = 128;
    explicit Profile(ByteSpan bytes) : bytes_(bytes) {}
    bool isComplete() const { return bytes_.size() >= kHead + 4 && begins(bytes_.subspan(36), "acsp"); }
    bool isFor(std::string_view space) const { return begins(bytes_.subspan(16), space); }
    /// The data of a tag; empty if the tag is not there.
    ByteSpan tag(std::string_view name) const {
        const std::size_t count = std::min<std::size_t>(big32(bytes_, kHead), (bytes_.size() - kHead - 4) / 12);
        for (std::size_t i = 0; i < count; ++i) {
            const std::size_t entry = kHead + 4 + 12 * i;
            if (!begins(bytes_.subspan(entry), name)) continue;
            const std::size_t at = big32(bytes_, entry + 4), length = big32(bytes_, entry + 8);
            return at <= bytes_.size() && length <= bytes_.size() - at ? bytes_.subspan(at, length) : ByteSpan();
        }
        return {};
    }

  private:
    ByteSpan bytes_;
};

double fixedAt(ByteSpan tag, std::size_t at) {
    return static_cast<std::int32_t>(big32(tag, at)) / 65536.0;
}

/// A parametric curve (10.18). Precondition: it has as many numbers as its kind asks for.
double parametric(ByteSpan tag, std::uint32_t kind, double x) {
    const auto p = [&](std::size_t i) { return fixedAt(tag, 12 + 4 * i); };
    const double g = p(0);
    const auto power = [&](double base) { return std::pow(std::max(base, 0.0), g); };
    switch (kind) {
        case 0:
            return power(x);
        case 1:
            return x >= -p(2) / p(1) ? power(p(1) * x + p(2)) : 0;
        case 2:
            return x >= -p(2) / p(1) ? power(p(1) * x + p(2)) + p(3) : p(3);
        case 3:
            return x >= p(4) ? power(p(1) * x + p(2)) : p(3) * x;
        default:
            return x >= p(4) ? power(p(1) * x + p(2)) + p(5) : p(3) * x + p(6);
    }
}

/// The light of a number from 0 to 1, by a curve's tag; none: it is no such curve.
std::optional<double> lightOf(ByteSpan tag, double x) {
    if (tag.size() < 12) return std::nullopt;
    if (begins(tag, "para")) {
        constexpr std::array<std::size_t, 5> kNumbers{1, 3, 4, 5, 7};
        const std::uint32_t kind = big16(tag, 8);
        if (kind >= kNumbers.size() || tag.size() < 12 + 4 * kNumbers[kind]) return std::nullopt;
        return parametric(tag, kind, x);
    }
    if (!begins(tag, "curv")) return std::nullopt;
    const std::size_t count = big32(tag, 8);
    if (count == 0) return x;
    if (count > (tag.size() - 12) / 2) return std::nullopt;
    if (count == 1) return std::pow(x, big16(tag, 12) / 256.0);
    const double position = x * static_cast<double>(count - 1);
    const std::size_t below = std::min(static_cast<std::size_t>(position), count - 2);
    const double fraction = position - static_cast<double>(below);
    return ((1 - fraction) * big16(tag, 12 + 2 * below) + fraction * big16(tag, 14 + 2 * below)) / 65535;
}

bool hasSrgbCurve(ByteSpan tag) {
    for (const double x : {.25, .5, .75}) {
        constexpr double kSeen = .02;  // sRGB's own curve is .01 off the power of 2.2 that stands for it in many files
        const auto light = lightOf(tag, x);
        if (!light || !(std::abs(*light - std::pow((x + .055) / 1.055, 2.4)) < kSeen)) return false;
    }
    return true;
}

bool isSrgb(const Profile& profile) {
    if (profile.isFor("GRAY")) return hasSrgbCurve(profile.tag("kTRC"));
    if (!profile.isFor("RGB ")) return false;
    struct Primary {
        std::string_view color, curve;
        std::array<double, 3> xyz;  // in the light of D50, as in sRGB's own profile
    };
    constexpr std::array kPrimaries{Primary{"rXYZ", "rTRC", {.4361, .2225, .0139}},
                                    Primary{"gXYZ", "gTRC", {.3851, .7169, .0971}},
                                    Primary{"bXYZ", "bTRC", {.1431, .0606, .7141}}};
    for (const Primary& primary : kPrimaries) {
        const ByteSpan color = profile.tag(primary.color);
        if (color.size() < 20 || !hasSrgbCurve(profile.tag(primary.curve))) return false;
        for (std::size_t i = 0; i < 3; ++i)
            if (!(std::abs(fixedAt(color, 8 + 4 * i) - primary.xyz[i]) < .01)) return false;
    }
    return true;
}

/// The description's text: all of an older one, the first language of a newer one, without characters beyond ASCII.
std::string nameOf(const Profile& profile) {
    const ByteSpan tag = profile.tag("desc");
    std::string name;
    const auto add = [&](std::uint32_t letter) {
        constexpr std::size_t kMax = 60;
        if (letter >= ' ' && letter < 0x7F && name.size() < kMax) name += static_cast<char>(letter);
    };
    if (begins(tag, "desc") && tag.size() >= 12) {
        const std::size_t length = std::min<std::size_t>(big32(tag, 8), tag.size() - 12);
        for (const std::uint8_t letter : tag.subspan(12, length)) add(letter);
    } else if (begins(tag, "mluc") && tag.size() >= 28) {
        const std::size_t length = big32(tag, 20), at = big32(tag, 24);
        for (std::size_t i = 0; i + 1 < length && at < tag.size() && i + 1 < tag.size() - at; i += 2)
            add(big16(tag, at + i));
    }
    return name;
}

}  // namespace

std::string foreignColorProfile(ByteSpan file) {
    const std::vector<std::uint8_t> found = profileIn(file);
    const Profile profile(found);
    if (!profile.isComplete() || isSrgb(profile)) return {};
    std::string name = nameOf(profile);
    // One with tables in place of primaries: its name is all there is to go by.
    if (profile.isFor("RGB ") && profile.tag("rXYZ").empty() && name.contains("sRGB")) return {};
    if (!name.empty()) return name;
    return profile.isFor("CMYK") ? "of inks" : "without a name";
}

}  // namespace rtsg
