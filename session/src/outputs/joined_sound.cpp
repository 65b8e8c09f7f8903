// Finds stretches of sound by their numbers and joins them.
#include <rtsg/session/joined_sound.h>

#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>

namespace rtsg {

namespace {

/// The stretches, one after the other.
class Joining {
  public:
    Joining(const std::string& pattern, const PictureRange& range, double picturesPerSecond)
        : pattern_(pattern), range_(range), picturesPerSecond_(picturesPerSecond) {}

    Result<JoinedSound> run() {
        for (std::uint64_t number = range_.first; number <= range_.last;) {
            if (!isThere(number)) {
                lacks(number++);
                continue;
            }
            auto next = add(number);
            if (!next) return std::unexpected(next.error());
            number = *next;
        }
        return std::move(joined_);
    }

  private:
    std::filesystem::path fileOf(std::uint64_t number) const {
        return pattern_.parent_path() / *numberedName(pattern_.filename().string(), static_cast<int>(number));
    }
    bool isThere(std::uint64_t number) const {
        std::error_code ignored;
        return std::filesystem::is_regular_file(fileOf(number), ignored);
    }
    void lacks(std::uint64_t number) {
        auto& missing = joined_.missing;
        if (!missing.empty() && missing.back().second + 1 == number)
            missing.back().second = number;
        else
            missing.emplace_back(number, number);
    }
    /// The number of the first sample of a picture, counted from the log's start.
    std::int64_t sampleOf(std::uint64_t number, int rate) const {
        return std::llround(static_cast<double>(number) / picturesPerSecond_ * rate);
    }

    /// Returns the number with which the next stretch begins.
    Result<std::uint64_t> add(std::uint64_t number) {
        const std::string name = fileOf(number).string();
        std::string damage;
        auto read = readSound(name, std::uint64_t{1} << 32, &damage);
        if (!read) return std::unexpected(read.error());
        if (!damage.empty()) return fail(damage, {}, name);
        SoundBuffer& sound = joined_.sound;
        const auto comment = readSoundComment(name);
        if (!comment) return std::unexpected(comment.error());
        const Provenance provenance = Provenance::of(*comment);
        if (!any_) {
            sound.sampleRate = read->sampleRate, sound.channels = read->channels;
            joined_.provenance = provenance, joined_.first = name;
        }
        any_ = true;
        if (auto ok = belongsTogether(provenance, name, joined_.provenance, joined_.first); !ok)
            return std::unexpected(ok.error());
        if (read->sampleRate != sound.sampleRate || read->channels != sound.channels)
            return fail("it has another rate or number of channels than the first stretch", {}, name);
        if (read->frames() == 0) return fail("it holds no sound", {}, name);
        const std::int64_t end = sampleOf(number, sound.sampleRate) + static_cast<std::int64_t>(read->frames());
        std::uint64_t next = number + 1;
        for (; sampleOf(next, sound.sampleRate) < end; ++next)
            if (next <= range_.last && isThere(next))
                return fail(fmt::format("it overlaps with {}, which begins within it", fileOf(next).string()), {},
                            name);
        // The last stretch may end anywhere, with the log.
        if (sampleOf(next, sound.sampleRate) != end && next <= range_.last)
            return fail(fmt::format("it ends within the time of picture {}: with --fps {:g} there is a gap", next - 1,
                                    picturesPerSecond_),
                        {}, name);
        const std::int64_t maximum = sampleOf(range_.last + 1, sound.sampleRate) - sampleOf(number, sound.sampleRate);
        const auto kept = static_cast<std::ptrdiff_t>(maximum) * sound.channels;
        const auto samples = static_cast<std::ptrdiff_t>(read->samples.size());
        sound.samples.insert(sound.samples.end(), read->samples.begin(),
                             read->samples.begin() + std::min(kept, samples));
        return next;
    }

    const std::filesystem::path pattern_;
    const PictureRange range_;
    const double picturesPerSecond_;
    bool any_ = false;
    JoinedSound joined_;
};

}  // namespace

Result<JoinedSound> joinSound(const std::string& pattern, const PictureRange& range, double picturesPerSecond) {
    return Joining(pattern, range, picturesPerSecond).run();
}

}  // namespace rtsg
