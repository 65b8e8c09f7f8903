// A stream in input mode, as bytes and back.
#pragma once

#include <rtsg/core/frame_input.h>
#include <rtsg/sync/change_codec.h>
#include <rtsg/sync/input_codec.h>
#include <rtsg/sync/input_replica.h>

namespace rtsg::test {

/// Takes an origin's sets, hands them to a replica through records.
struct InputWire {
    explicit InputWire(Scene& replicaScene) : replica(replicaScene) {}
    InputReplica replica;
    ChangeEncoder states;
    InputEncoder inputs;
    ChangeDecoder stateDecoder{builtinTypes()};
    InputDecoder inputDecoder;
    ByteBuffer record;
    std::size_t bytes = 0, stateFrames = 0, inputFrames = 0;

    /// Empty if the replica is in the set's state afterwards.
    std::string take(const ChangeSet& set) {
        if (!needsState(set)) {
            inputs.encode(set, record);
            ++inputFrames;
            return deliver();
        }
        states.encode(set, record);
        ++stateFrames;
        if (auto problem = deliver(); !problem.empty()) return problem;
        if (auto ok = inputs.encodeRunState(set, record); !ok) return ok.error().text;
        return deliver();
    }
    std::string deliver() {
        bytes += record.size();
        const auto header = checkRecord(record.bytes());
        if (!header) return header.error().text;
        auto set = std::make_shared<ChangeSet>();
        const auto decoded = header->kind == RecordKind::input ? inputDecoder.decode(record.bytes(), *set)
                                                               : stateDecoder.decode(record.bytes(), *set);
        if (!decoded) return decoded.error().text;
        const auto taken = replica.take(set);
        if (!taken) return taken.error().text;
        return *taken ? std::string() : replica.why();
    }
};

}  // namespace rtsg::test
