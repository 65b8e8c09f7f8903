// Reads OpenEXR files of 32-bit numbers whole, with their channels and text attributes, for the module librtsg_exr.so.
#include <algorithm>
#include <cstring>
#include <exception>

#include <openexr.h>

#include "image/image_files.h"

namespace {

using rtsg::ExrContent;

constexpr int kMaxTileSide = 1 << 16;
constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 34;

/// A file that is being read. The first error that the library tells stays here.
struct Reading {
    std::span<const std::uint8_t> file;
    exr_context_t context = nullptr;
    const char* error = nullptr;

    explicit Reading(std::span<const std::uint8_t> from) : file(from) {}
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;
    ~Reading() {
        if (context) exr_finish(&context);
    }
    bool done(exr_result_t result) {
        if (result != EXR_ERR_SUCCESS && !error) error = exr_get_default_error_message(result);
        return result == EXR_ERR_SUCCESS;
    }
    bool refuse(const char* why) {
        if (!error) error = why;
        return false;
    }
};

int64_t readBytes(exr_const_context_t, void* from, void* to, uint64_t size, uint64_t offset,
                  exr_stream_error_func_ptr_t) {
    const std::span<const std::uint8_t> file = static_cast<Reading*>(from)->file;
    if (offset >= file.size()) return 0;
    const std::uint64_t there = std::min<std::uint64_t>(size, file.size() - offset);
    std::memcpy(to, file.data() + offset, there);
    return static_cast<int64_t>(there);
}
int64_t sizeOf(exr_const_context_t, void* from) {
    return static_cast<int64_t>(static_cast<Reading*>(from)->file.size());
}

bool readHeader(Reading& reading, ExrContent& out) {
    const exr_context_t file = reading.context;
    exr_storage_t storage{};
    exr_attr_box2i_t window{};
    const exr_attr_chlist_t* channels = nullptr;
    if (!reading.done(exr_get_storage(file, 0, &storage)) || !reading.done(exr_get_data_window(file, 0, &window)) ||
        !reading.done(exr_get_channels(file, 0, &channels)))
        return false;
    if (storage != EXR_STORAGE_SCANLINE) return reading.refuse("its pixels are not stored line by line");
    const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1,
                       height = std::int64_t{window.max.y} - window.min.y + 1;
    if (window.min.x != 0 || window.min.y != 0) return reading.refuse("its lines do not begin at 0, 0");
    if (width < 1 || height < 1 || width > kMaxTileSide || height > kMaxTileSide ||
        static_cast<std::uint64_t>(width * height) * sizeof(float) *
                static_cast<std::uint64_t>(channels->num_channels) >
            kMaxBytes)
        return reading.refuse("it has more pixels than are read");
    out.width = static_cast<int>(width), out.height = static_cast<int>(height);
    for (int i = 0; i < channels->num_channels; ++i) {
        const exr_attr_chlist_entry_t& entry = channels->entries[i];
        if (entry.pixel_type == EXR_PIXEL_HALF) return reading.refuse("its numbers have 16 bits");
        if (entry.x_sampling != 1 || entry.y_sampling != 1) return reading.refuse("a channel has not every pixel");
        out.channels.push_back({entry.name.str, entry.pixel_type == EXR_PIXEL_UINT, {}});
    }
    return true;
}

bool readNotes(Reading& reading, ExrContent& out) {
    std::int32_t count = 0;
    if (!reading.done(exr_get_attribute_count(reading.context, 0, &count))) return false;
    for (std::int32_t i = 0; i < count; ++i) {
        const exr_attribute_t* note = nullptr;
        if (!reading.done(exr_get_attribute_by_index(reading.context, 0, EXR_ATTR_LIST_FILE_ORDER, i, &note)))
            return false;
        // The writer adds these itself.
        const std::string_view name = note->name;
        if (note->type != EXR_ATTR_STRING || name == "type" || name == "capDate") continue;
        out.notes.emplace_back(note->name,
                               std::string(note->string->str, static_cast<std::size_t>(note->string->length)));
    }
    return true;
}

bool readLines(Reading& reading, ExrContent& out) {
    const exr_context_t file = reading.context;
    const auto width = static_cast<std::size_t>(out.width);
    for (ExrContent::Channel& channel : out.channels)
        channel.values.resize(width * static_cast<std::size_t>(out.height));
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    bool good = true;
    for (int y = 0; good && y < out.height;) {
        exr_chunk_info_t block;
        good = reading.done(exr_read_scanline_chunk_info(file, 0, y, &block)) &&
               reading.done(y == 0 ? exr_decoding_initialize(file, 0, &block, &pipeline)
                                   : exr_decoding_update(file, 0, &block, &pipeline));
        if (!good) break;
        if (block.start_y != y || block.height < 1 || block.height > out.height - y) {
            good = reading.refuse("its lines are not in order");
            break;
        }
        for (int i = 0; i < pipeline.channel_count; ++i) {
            exr_coding_channel_info_t& info = pipeline.channels[i];
            const auto channel =
                std::ranges::find(out.channels, std::string_view(info.channel_name), &ExrContent::Channel::name);
            info.user_pixel_stride = sizeof(float), info.user_line_stride = static_cast<int32_t>(width * sizeof(float));
            info.decode_to_ptr =
                reinterpret_cast<uint8_t*>(channel->values.data() + static_cast<std::size_t>(y) * width);
        }
        good = (y > 0 || reading.done(exr_decoding_choose_default_routines(file, 0, &pipeline))) &&
               reading.done(exr_decoding_run(file, 0, &pipeline));
        y += block.height;
    }
    exr_decoding_destroy(file, &pipeline);
    return good;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* RTSG_READ_EXR_SYMBOL(std::span<const std::uint8_t> bytes,
                                                                                   ExrContent& out) {
    out = {};
    Reading reading(bytes);
    exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
    settings.user_data = &reading;
    settings.read_fn = readBytes, settings.size_fn = sizeOf;
    settings.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};  // it would print
    try {
        if (reading.done(exr_start_read(&reading.context, "memory", &settings)) && readHeader(reading, out) &&
            readNotes(reading, out) && readLines(reading, out))
            return nullptr;
    } catch (const std::exception&) {
        return "there is not enough memory for it";
    }
    return reading.error ? reading.error : "it cannot be read";
}
