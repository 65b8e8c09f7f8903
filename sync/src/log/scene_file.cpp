// Writes a scene's snapshot as one record, and reads the first state of such a file or of a log.
#include <rtsg/sync/scene_file.h>

#include <array>
#include <fstream>

#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/log.h>

namespace rtsg {

Result<> writeSceneFile(const Scene& scene, const std::filesystem::path& file, Existing existing) {
    auto out = OutputFile::create(file, existing);
    if (!out) return std::unexpected(out.error());
    const auto text = [](const ByteBuffer& record) {
        return std::string_view(reinterpret_cast<const char*>(record.data()), record.size());
    };
    const ChangeSet snapshot = scene.snapshot();
    ByteBuffer record;
    ChangeEncoder encoder;
    if (!encoder.encodeScene(snapshot, record))
        return fail("a built-in node type is not in sync/catalogue.bin as it is now: its test says what appends it", {},
                    file.string());
    if (auto ok = out->write(text(record)); !ok) return ok;
    return out->commit();
}

Result<> readSceneFile(Scene& scene, const std::filesystem::path& file) {
    constexpr std::uint64_t longest = std::uint64_t{1} << 32;
    auto log = LogReader::open(file, longest);
    if (!log) return std::unexpected(log.error());
    ChangeDecoder decoder(builtinTypes());
    decoder.countOriginHash();
    bool headed = false;
    while (const auto record = log->next()) {
        if (record->header.kind == RecordKind::head) {
            const auto head = decodeHead(record->bytes);
            if (!head) return std::unexpected(head.error());
            if (auto ok = decoder.setHead(*head); !ok) return ok;
            headed = true;
        } else if (record->header.kind == RecordKind::keyframe || record->header.kind == RecordKind::scene) {
            if (!headed && record->header.kind == RecordKind::keyframe)
                return fail("it has no head", {}, file.string());
            auto set = std::make_shared<ChangeSet>();
            if (auto ok = decoder.decode(record->bytes, *set); !ok) return ok;
            if (auto ok = scene.apply(std::move(set)); !ok) return ok;
            if (decoder.originHash().value_or(scene.hash()) != record->header.hash)
                return fail("its state is not the one that was written", {}, file.string());
            return {};
        }
    }
    if (!log->damage().empty()) return fail("it is damaged: " + log->damage().front().text, {}, file.string());
    return fail("it holds no state", {}, file.string());
}

bool isSceneFile(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    std::array<char, kRecordMagic.size()> head{};
    in.read(head.data(), head.size());
    return in && std::string_view(head.data(), head.size()) == kRecordMagic;
}

}  // namespace rtsg
