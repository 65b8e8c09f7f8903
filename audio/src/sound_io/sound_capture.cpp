// Records from a device, by OpenAL's capture extension.
#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include <rtsg/audio/sound_input.h>

#include "openal_context.h"

namespace rtsg {
namespace {

/// Names follow each other, each ended by a zero, the last by two.
std::string captureDevices() {
    const ALCchar* names = alcGetString(nullptr, ALC_CAPTURE_DEVICE_SPECIFIER);
    std::string list;
    while (names && *names) {
        const std::string name = names;
        list += fmt::format("{}'{}'", list.empty() ? "" : ", ", name);
        names += name.size() + 1;
    }
    return list;
}

}  // namespace

Result<std::shared_ptr<SoundInput>> SoundInput::openDevice(const std::string& name, int sampleRate) {
    if (const auto loaded = delayed::openal.load(); !loaded) return std::unexpected(loaded.error());
    const ShortPeriods periods;  // for whoever plays: settings are read but once
    if (!alcIsExtensionPresent(nullptr, "ALC_EXT_CAPTURE")) return fail("this OpenAL cannot capture sound");
    const auto buffered = static_cast<ALCsizei>(sampleRate / 5);
    const std::shared_ptr<ALCdevice> device(
        alcCaptureOpenDevice(name.empty() ? nullptr : name.c_str(), static_cast<ALCuint>(sampleRate), AL_FORMAT_MONO16,
                             buffered),
        [](ALCdevice* opened) {
            if (opened) alcCaptureCloseDevice(opened);
        });
    if (!device) {
        const std::string others = captureDevices();
        return fail(fmt::format("there is no device{} that sound can be captured from; {}",
                                name.empty() ? "" : " '" + name + "'",
                                others.empty() ? "OpenAL knows of none" : "there are: " + others));
    }
    return std::make_shared<SoundInput>(sampleRate, Waits::no, [device, sampleRate, buffered](SoundFeed& feed) {
        if (auto ok = feed.begin(1, sampleRate); !ok) return feed.fail(ok.error().text);
        alcCaptureStart(device.get());
        std::vector<ALshort> taken;
        std::vector<float> samples;
        while (feed.wanted()) {
            ALCint there = 0, connected = ALC_TRUE;
            alcGetIntegerv(device.get(), ALC_CAPTURE_SAMPLES, 1, &there);
            if (alcIsExtensionPresent(device.get(), "ALC_EXT_disconnect"))
                alcGetIntegerv(device.get(), ALC_CONNECTED, 1, &connected);
            if (there <= 0) {
                if (connected == ALC_FALSE) return feed.fail("the device was taken away");
                std::this_thread::sleep_for(std::chrono::milliseconds(2));
                continue;
            }
            // Drivers that never run out say absurd numbers.
            there = std::min(there, buffered);
            taken.resize(static_cast<std::size_t>(there));
            alcCaptureSamples(device.get(), taken.data(), there);
            samples.clear();
            for (const ALshort sample : taken) samples.push_back(static_cast<float>(sample) / 32768.0f);
            feed.write(samples);
        }
        alcCaptureStop(device.get());
    });
}

}  // namespace rtsg
