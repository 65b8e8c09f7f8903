// Frames that the next one says anew: those of plain values of the very same fields, and no others.
#include "mirror/superseded.h"

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>

namespace rtsg {
namespace {

Change plainOf(std::uint32_t node, FieldIndex field, Value value) {
    Change change;
    change.node = NodeId{node};
    change.field = field;
    change.value = std::move(value);
    return change;
}

ByteBuffer frameOf(std::vector<Change> changes) {
    ChangeSet set;
    set.from = 1;
    set.to = 2;
    set.changes = std::move(changes);
    ByteBuffer record;
    ChangeEncoder().encode(set, record);
    return record;
}

bool superseded(const std::vector<Change>& frame, const std::vector<Change>& next) {
    return mirror::isSuperseded(frameOf(frame).bytes(), frameOf(next).bytes());
}

TEST(Superseded, OnlyTheSameFieldsOfTheSameNodesAreSaidAnew) {
    const std::vector<Change> frame = {plainOf(300, 1, Vec3f(1, 2, 3)), plainOf(301, 1, Vec3f(4, 5, 6)),
                                       plainOf(300, 2, 1.5)};
    const auto with = [&](std::size_t i, Change change) {
        std::vector<Change> other = frame;
        other[i] = std::move(change);
        return other;
    };
    EXPECT_TRUE(superseded(frame, frame));
    EXPECT_TRUE(superseded(frame, with(1, plainOf(301, 1, Vec3f(-4, 0, 0)))));
    EXPECT_FALSE(superseded(frame, with(1, plainOf(302, 1, Vec3f(4, 5, 6))))) << "another node";
    EXPECT_FALSE(superseded(frame, with(2, plainOf(300, 3, 1.5)))) << "another field";
    EXPECT_FALSE(superseded(frame, with(2, plainOf(300, 2, 1.5f)))) << "another type";
    std::vector<Change> more = frame;
    more.push_back(plainOf(302, 1, Vec3f()));
    EXPECT_FALSE(superseded(frame, more)) << "one field more";
    EXPECT_FALSE(superseded(more, frame)) << "one field less";
    more = frame;
    more.push_back(plainOf(300, 4, true));
    EXPECT_FALSE(superseded(frame, more)) << "one column more";
    EXPECT_FALSE(superseded(more, frame)) << "one column less";
    EXPECT_TRUE(superseded(more, more));
}

TEST(Superseded, WhatIsNoPlainValueIsKept) {
    const std::vector<Change> frame = {plainOf(300, 1, Vec3f(1, 2, 3))};
    std::vector<Change> named = frame, listed = frame, event = frame;
    named.push_back(plainOf(300, kNoField, String("A")));
    named.back().kind = ChangeKind::setName;
    listed.push_back(plainOf(300, 5, Array<Vec3f>{Vec3f()}));
    event.push_back(plainOf(300, 1, Vec3f()));
    event.back().kind = ChangeKind::event;
    for (const std::vector<Change>& other : {named, listed, event}) {
        EXPECT_FALSE(superseded(other, frame));
        EXPECT_FALSE(superseded(frame, other));
        EXPECT_FALSE(superseded(other, other));
    }
}

}  // namespace
}  // namespace rtsg
