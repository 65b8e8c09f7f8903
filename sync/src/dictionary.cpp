#include <rtsg/sync/dictionary.h>

#include <rtsg/sync/record.h>

#include "wire.h"

namespace rtsg {

namespace {

void putDictionary(ByteBuffer& out, TypeTable types) {
    out.putVarint(types.size());
    for (const auto& type : types) wire::putType(out, *type);
}

}  // namespace

std::uint64_t dictionaryHash(TypeTable types) {
    ByteBuffer bytes;
    putDictionary(bytes, types);
    return checksumOf(bytes.bytes());
}

void encodeHead(std::uint64_t epoch, std::string_view creator, TypeTable types, bool withDictionary,
                ByteBuffer& record) {
    ByteBuffer dictionary;
    putDictionary(dictionary, types);
    record.clear();
    record.room(kRecordHeaderSize);
    record.advance(kRecordHeaderSize);
    record.put(kFormatVersion);
    record.put(epoch);
    record.put(checksumOf(dictionary.bytes()));
    wire::putText(record, creator);
    record.putVarint(withDictionary ? dictionary.size() : 0);
    if (withDictionary) record.append(dictionary.bytes());
    RecordHeader header;
    header.kind = RecordKind::head;
    sealRecord(record, header);
}

Result<StreamHead> decodeHead(std::span<const std::byte> record, std::uint64_t known) {
    wire::Reader in(recordPayload(record), kRecordHeaderSize);
    StreamHead head;
    head.formatVersion = in.number<std::uint32_t>();
    if (!in.problem && head.formatVersion != kFormatVersion) in.refuse("format version unknown to this reader");
    head.epoch = in.number<std::uint64_t>();
    head.dictionaryHash = in.number<std::uint64_t>();
    head.creator = in.text();
    wire::Reader dictionary = in.part(in.count(1));
    if (dictionary.left()) {
        if (checksumOf({dictionary.begin, dictionary.left()}) != head.dictionaryHash)
            dictionary.refuse("dictionary does not have the hash it names");
        if (!dictionary.problem && head.dictionaryHash == known) return head;
        const std::size_t types = dictionary.count(1);
        for (std::size_t i = 0; i < types && !dictionary.problem; ++i) head.types.push_back(wire::readType(dictionary));
        if (!dictionary.problem && dictionary.left()) dictionary.refuse("bytes after the dictionary's last type");
    }
    if (in.problem) return std::unexpected(wire::describe(in, "head"));
    if (dictionary.problem) return std::unexpected(wire::describe(dictionary, "dictionary"));
    return head;
}

}  // namespace rtsg
