// The module librtsg_exr.so: OpenEXR files by the core of OpenEXR, which loads quickly. It does not link this project's
// libraries, and throws only if memory runs out.
#include <algorithm>
#include <cstring>
#include <new>

#include <openexr.h>

#include "image/image_files.h"

namespace {

using rtsg::Sheet;
using rtsg::SheetChannel;

/// A file that is being written. It keeps the library's last error message here, since a thrown one is more general.
struct Writing {
    std::vector<unsigned char>& file;
    exr_context_t context = nullptr;
    const char* error = nullptr;

    explicit Writing(std::vector<unsigned char>& to) : file(to) {}
    Writing(const Writing&) = delete;
    Writing& operator=(const Writing&) = delete;
    ~Writing() {
        if (context) exr_finish(&context);
    }
    /// Notes what did not work.
    bool done(exr_result_t result) {
        if (result != EXR_ERR_SUCCESS && !error) error = exr_get_default_error_message(result);
        return result == EXR_ERR_SUCCESS;
    }
};

/// The library writes the table of its blocks last, in their place.
int64_t writeBytes(exr_const_context_t, void* to, const void* bytes, uint64_t size, uint64_t offset,
                   exr_stream_error_func_ptr_t) {
    std::vector<unsigned char>& file = static_cast<Writing*>(to)->file;
    try {
        if (file.size() < offset + size) file.resize(offset + size);
    } catch (const std::bad_alloc&) {
        return -1;
    }
    std::memcpy(file.data() + offset, bytes, size);
    return static_cast<int64_t>(size);
}

/// Colour, coverage, and the other data of each pixel.
std::vector<SheetChannel> channelsOf(const Sheet& sheet) {
    std::vector<SheetChannel> all{
        {"R", sheet.values, 4}, {"G", sheet.values + 1, 4}, {"B", sheet.values + 2, 4}, {"A", sheet.values + 3, 4}};
    all.insert(all.end(), sheet.channels.begin(), sheet.channels.end());
    return all;
}

bool writeHeader(Writing& writing, const Sheet& sheet, const std::vector<SheetChannel>& channels) {
    const exr_context_t file = writing.context;
    constexpr std::size_t kShortName = 31;
    const auto isLong = [](const std::string& name) { return name.size() > kShortName; };
    const bool longNames = std::ranges::any_of(channels, isLong, &SheetChannel::name) ||
                           std::ranges::any_of(sheet.notes, isLong, [](const auto& note) { return note.first; });
    int part = 0;
    bool good =
        (!longNames || writing.done(exr_set_longname_support(file, 1))) &&
        writing.done(exr_add_part(file, nullptr, EXR_STORAGE_SCANLINE, &part)) &&
        writing.done(exr_initialize_required_attr_simple(file, part, sheet.width, sheet.height, EXR_COMPRESSION_ZIP));
    for (const SheetChannel& channel : channels)
        good = good && writing.done(exr_add_channel(file, part, channel.name.c_str(),
                                                    channel.integers ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT,
                                                    EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1));
    // That of its making would make files of two runs differ.
    good = good && writing.done(exr_attr_set_string(file, part, "capDate", "1970:01:01 00:00:00"));
    for (const auto& [key, text] : sheet.notes)
        good = good && writing.done(exr_attr_set_string(file, part, key.c_str(), text.c_str()));
    return good && writing.done(exr_write_header(file));
}

/// Tells the library where the numbers of a block of lines are. It has the channels in an order of its own.
void pointTo(exr_encode_pipeline_t& pipeline, const Sheet& sheet, const std::vector<SheetChannel>& channels) {
    for (int i = 0; i < pipeline.channel_count; ++i) {
        exr_coding_channel_info_t& info = pipeline.channels[i];
        const auto channel = std::ranges::find(channels, std::string_view(info.channel_name), &SheetChannel::name);
        const std::size_t row = static_cast<std::size_t>(sheet.width) * channel->stride;
        info.user_pixel_stride = static_cast<int32_t>(channel->stride * sizeof(float));
        info.user_line_stride = static_cast<int32_t>(row * sizeof(float));
        info.encode_from_ptr =
            reinterpret_cast<const uint8_t*>(channel->first + static_cast<std::size_t>(pipeline.chunk.start_y) * row);
    }
}

bool writeLines(Writing& writing, const Sheet& sheet, const std::vector<SheetChannel>& channels) {
    const exr_context_t file = writing.context;
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    bool good = true;
    for (int y = 0; good && y < sheet.height;) {
        exr_chunk_info_t block;
        good = writing.done(exr_write_scanline_chunk_info(file, 0, y, &block));
        if (!good) break;
        const bool first = y == 0;
        good = writing.done(first ? exr_encoding_initialize(file, 0, &block, &pipeline)
                                  : exr_encoding_update(file, 0, &block, &pipeline));
        if (!good) break;
        pointTo(pipeline, sheet, channels);
        good = (!first || writing.done(exr_encoding_choose_default_routines(file, 0, &pipeline))) &&
               writing.done(exr_encoding_run(file, 0, &pipeline));
        y += block.height;
    }
    exr_encoding_destroy(file, &pipeline);
    return good;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const char* RTSG_ENCODE_EXR_SYMBOL(const Sheet& sheet,
                                                                                     std::vector<unsigned char>& file) {
    file.clear();
    Writing writing(file);
    exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
    settings.user_data = &writing;
    settings.write_fn = writeBytes;
    settings.zip_level = 4;  // as OpenEXR has it itself; zlib's own 6 takes twice as long for some percent less
    settings.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};  // it would print
    const std::vector<SheetChannel> channels = channelsOf(sheet);
    if (!writing.done(exr_start_write(&writing.context, "memory", EXR_WRITE_FILE_DIRECTLY, &settings)) ||
        !writeHeader(writing, sheet, channels) || !writeLines(writing, sheet, channels))
        return writing.error;
    // With this comes the table of blocks.
    return writing.done(exr_finish(&writing.context)) ? nullptr : writing.error;
}
