// Gives sounds to workers of the sandbox, and checks what comes out.
#include "sandbox_sounds.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <rtsg/core/sandbox.h>

#include "signal/sound_libraries.h"
#include "sound_length.h"

namespace rtsg {

namespace {

enum class SoundAction : std::uint32_t { read, check, length };

struct SoundJob {
    SoundAction action = SoundAction::read;
    std::uint32_t hasBytes = 0;
    std::int64_t size = 0;
    std::uint64_t maxSamples = 0;
};
struct SoundQuestion {
    std::uint64_t offset = 0, length = 0;
};
/// A sentence follows: the damage.
struct SoundAnswer {
    std::int32_t sampleRate = 0, channels = 0;
    double seconds = 0;
};

// ---- in the worker ---------------------------------------------------------------------------------------------

/// The error of a Result, as what serve() throws.
struct SoundProblem final : std::runtime_error {
    using std::runtime_error::runtime_error;
};
template <class T>
T orThrow(Result<T> result) {
    if (!result) throw SoundProblem(result.error().text);
    return std::move(*result);
}

SoundBytes bytesOf(SandboxJob& job, const SoundJob& wanted) {
    if (wanted.hasBytes != 0)
        return SoundBytes::of({reinterpret_cast<const char*>(job.bytes().data()), job.bytes().size()});
    return {[&job](std::uint64_t offset, std::span<char> to) {
                std::size_t done = 0;
                while (done < to.size()) {
                    const std::string part =
                        job.ask(sandboxText(SoundQuestion{offset + done, std::min(to.size() - done, kMaxSandboxText)}));
                    if (part.empty()) break;
                    done += part.copy(to.data() + done, to.size() - done);
                }
                return done;
            },
            wanted.size};
}

Result<> prepareSounds() {
    return delayed::sound.load();
}

void serveSounds(SandboxJob& job) {
    SoundJob wanted;
    std::string_view head = job.head();
    takeSandboxNumbers(head, wanted);
    SoundBytes bytes = bytesOf(job, wanted);
    if (wanted.action == SoundAction::check) {
        if (const auto ok = checkSoundHere(std::move(bytes)); !ok) throw SoundProblem(ok.error().text);
        return job.answer(sandboxText(SoundAnswer{}));
    }
    if (wanted.action == SoundAction::length)
        return job.answer(sandboxText(SoundAnswer{0, 0, orThrow(soundSecondsHere(std::move(bytes)))}));
    std::string damage;
    const SoundBuffer sound = orThrow(readSoundHere(std::move(bytes), wanted.maxSamples, damage));
    const std::size_t size = sound.samples.size() * sizeof(float);
    std::memcpy(job.room(size).data(), sound.samples.data(), size);
    job.answer(sandboxText(SoundAnswer{sound.sampleRate, sound.channels, 0}, damage));
}

constexpr SandboxTask kSounds{"sounds", prepareSounds, serveSounds};

// ---- in the process that wants the sound -------------------------------------------------------------------------

Result<SandboxResult> runSounds(SoundAction action, const SoundBytes& file, std::string_view whole,
                                std::uint64_t maxSamples) {
    const SoundJob wanted{action, whole.empty() ? 0U : 1U, file.size, maxSamples};
    const auto answers = [&file](std::string_view text) -> std::string {
        SoundQuestion asked;
        if (!takeSandboxNumbers(text, asked) || asked.offset > INT64_MAX) return {};
        return file.part(static_cast<std::int64_t>(asked.offset),
                         static_cast<std::int64_t>(std::min<std::uint64_t>(asked.length, kMaxSandboxText)));
    };
    return runSandboxed(kSounds, sandboxText(wanted),
                        {reinterpret_cast<const std::uint8_t*>(whole.data()), whole.size()}, answers);
}

constexpr const char* kBroken = "cannot read sound: the library that reads it is broken";

}  // namespace

Result<SoundBuffer> readSoundSandboxed(const SoundBytes& file, std::string_view whole, std::uint64_t maxSamples,
                                       std::string& damage) {
    const auto result = runSounds(SoundAction::read, file, whole, maxSamples);
    if (!result) return fail(result.error().text);
    SoundAnswer answer;
    std::string_view text = result->head();
    SoundBuffer sound;
    if (!takeSandboxNumbers(text, answer) || answer.sampleRate < 1 || answer.sampleRate > 1'000'000 ||
        answer.channels < 1 || answer.channels > 64 ||
        result->size() % (sizeof(float) * static_cast<std::size_t>(answer.channels)) != 0)
        return fail(kBroken);
    if (result->size() / sizeof(float) > maxSamples) return tooManySamples(maxSamples);
    sound.sampleRate = answer.sampleRate, sound.channels = answer.channels;
    sound.samples.resize(result->size() / sizeof(float));
    if (!result->read({reinterpret_cast<std::uint8_t*>(sound.samples.data()), result->size()})) return fail(kBroken);
    for (float& sample : sound.samples)
        if (!std::isfinite(sample)) sample = 0;
    damage = text;
    return sound;
}

Result<> checkSoundSandboxed(const SoundBytes& file) {
    const auto result = runSounds(SoundAction::check, file, {}, 0);
    return result ? Result<>() : fail(result.error().text);
}

Result<double> soundSecondsSandboxed(const SoundBytes& file) {
    const auto result = runSounds(SoundAction::length, file, {}, 0);
    if (!result) return fail(result.error().text);
    SoundAnswer answer;
    std::string_view text = result->head();
    if (!takeSandboxNumbers(text, answer) || !std::isfinite(answer.seconds) || answer.seconds < 0) return fail(kBroken);
    return answer.seconds;
}

}  // namespace rtsg
