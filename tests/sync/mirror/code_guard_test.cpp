// No peer makes the origin open a file or run a program unless it has been given the permission `code`: every kind of
// request is tried against every kind of field that does.
#include <gtest/gtest.h>

#include <rtsg/core/diagnostic.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/change_codec.h>

#include "edits/upstream.h"

namespace rtsg {
namespace {

constexpr const char* kScene = R"(#X3D V4.0 utf8
PROTO Model [ inputOutput MFString source [] inputOnly SFBool show ] {
  Group { children Inline { url IS source load IS show } }
}
PROTO Nested [ inputOutput MFString model [] ] { Model { source IS model } }
PROTO Door [ inputOnly SFBool set_open ] {
  Script { inputOnly SFBool open IS set_open outputOnly SFBool opened url "ecmascript: function open(v) { opened = v }" }
}
DEF INLINE Inline { load FALSE }
DEF SHAPE Shape { appearance Appearance { texture DEF TEXTURE ImageTexture { } } }
DEF BACK Background { }
DEF SOUND Sound { source DEF CLIP AudioClip { } }
DEF GEO GeoLOD { }
DEF SCRIPT Script { inputOnly SFBool on inputOutput SFBool lit FALSE url "ecmascript: function on(v) { lit = v }" }
DEF MODEL Model { }
DEF NESTED Nested { }
DEF DOOR Door { }
DEF NOTE Anchor { parameter "as it was" }
DEF WAY Anchor { }
DEF BOX Transform { }
ROUTE NOTE.parameter TO INLINE.url
)";

struct CodeGuard : ::testing::Test {
    Scene scene;
    CodeGuard() {
        Diagnostics diagnostics("scene");
        EXPECT_TRUE(loadText(scene, kScene, diagnostics));
        EXPECT_TRUE(diagnostics.all().empty());
        scene.newFrame(0);
    }
    NodeId at(const char* name) const { return scene.findName(name); }
    FieldIndex field(const char* node, const char* name) const {
        const FieldIndex found = scene.node(at(node)).type().find(name);
        EXPECT_NE(found, kNoField) << node << "." << name;
        return found;
    }
    std::string refusal(std::vector<Change> changes, MirrorUpstream permission) {
        ChangeSet set;
        set.from = set.to = 1;
        set.changes = std::move(changes);
        ByteBuffer record;
        ChangeEncoder().encode(set, record);
        mirror::Submission submission;
        submission.permission = permission;
        submission.record.assign(record.bytes().begin(), record.bytes().end());
        mirror::Writers writers;
        return mirror::carryOut(scene, submission, writers).refusal;
    }
    Change sets(const char* node, const char* name, Value value, bool event = false) const {
        Change change;
        change.kind = event ? ChangeKind::event : ChangeKind::setField;
        change.node = at(node);
        change.field = field(node, name);
        change.value = std::move(value);
        return change;
    }
    Change routes(const char* from, const char* out, const char* to, const char* in,
                  ChangeKind kind = ChangeKind::addRoute) const {
        Change change;
        change.kind = kind;
        change.node = at(from);
        change.field = field(from, out);
        change.other = at(to);
        change.index = field(to, in);
        return change;
    }
    /// Refused below `code`, for that reason, and nothing of it is done; accepted with it.
    void expectGuarded(const std::vector<Change>& changes, const std::string& reason,
                       MirrorUpstream minimum = MirrorUpstream::edits) {
        const Hash128 before = scene.hash();
        const std::string why = refusal(changes, minimum);
        EXPECT_NE(why.find(reason), std::string::npos) << "'" << why << "' for want of '" << reason << "'";
        scene.newFrame(scene.now() + 1);
        EXPECT_EQ(scene.hash().hex(), before.hex()) << reason;
        EXPECT_EQ(refusal(changes, MirrorUpstream::code), "") << reason;
        scene.newFrame(scene.now() + 1);
    }
};

const Value kUrls = Array<String>{String("ecmascript: function initialize() { }")};

TEST_F(CodeGuard, EventsAndEditsOfUrls) {
    const std::pair<const char*, const char*> kFields[] = {
        {"INLINE", "url"}, {"TEXTURE", "url"}, {"BACK", "frontUrl"}, {"CLIP", "url"}, {"GEO", "child1Url"}};
    for (const auto& [node, name] : kFields) {
        const bool event = scene.node(at(node)).type().fields[field(node, name)].writable();
        if (event) expectGuarded({sets(node, name, kUrls, true)}, name, MirrorUpstream::events);
        expectGuarded({sets(node, name, Array<String>{String("other.x3d")})}, name);
    }
    expectGuarded({sets("INLINE", "load", true, true)}, "Inline.load", MirrorUpstream::events);
    expectGuarded({sets("INLINE", "autoRefresh", Time{1})}, "Inline.autoRefresh");
}

TEST_F(CodeGuard, WhatBelongsToAScript) {
    expectGuarded({sets("SCRIPT", "url", kUrls, true)}, "may not touch Scripts", MirrorUpstream::events);
    expectGuarded({sets("SCRIPT", "on", true, true)}, "may not touch Scripts", MirrorUpstream::events);
    expectGuarded({sets("SCRIPT", "url", Array<String>{String("other.js")})}, "may not touch Scripts");
    expectGuarded({sets("SCRIPT", "mustEvaluate", true)}, "may not touch Scripts");
    Change name;
    name.kind = ChangeKind::setName;
    name.node = at("SCRIPT");
    name.value = String("ANOTHER");
    EXPECT_NE(refusal({name}, MirrorUpstream::edits).find("may not touch Scripts"), std::string::npos);
    Change destroy;
    destroy.kind = ChangeKind::destroyNode;
    destroy.node = at("SCRIPT");
    expectGuarded({destroy}, "may not touch Scripts");
}

TEST_F(CodeGuard, RoutesToUrlsAndScripts) {
    expectGuarded({routes("WAY", "parameter", "INLINE", "url")}, "Inline.url");
    expectGuarded({routes("WAY", "parameter", "NOTE", "parameter")}, "Inline.url");  // from there a route leads on
    expectGuarded({routes("WAY", "parameter", "MODEL", "source")}, "Inline.url");
    expectGuarded({routes("NOTE", "parameter", "INLINE", "url", ChangeKind::removeRoute)}, "Inline.url");
    expectGuarded({routes("BOX", "bboxDisplay", "SCRIPT", "on")}, "may not touch Scripts");
    expectGuarded({routes("SCRIPT", "lit", "BOX", "bboxDisplay")}, "may not touch Scripts");
}

TEST_F(CodeGuard, WaysThroughRoutesAndPrototypes) {
    expectGuarded({sets("NOTE", "parameter", kUrls, true)}, "Inline.url", MirrorUpstream::events);
    expectGuarded({sets("MODEL", "source", kUrls, true)}, "Inline.url", MirrorUpstream::events);
    expectGuarded({sets("MODEL", "show", true, true)}, "Inline.load", MirrorUpstream::events);
    expectGuarded({sets("NESTED", "model", kUrls, true)}, "Inline.url", MirrorUpstream::events);
    expectGuarded({sets("NESTED", "model", Array<String>{String("other.x3d")})}, "Inline.url");
}

TEST_F(CodeGuard, NewNodes) {
    const auto create = [&](std::string_view type) {
        Change change;
        change.kind = ChangeKind::createNode;
        change.node = NodeId{mirror::kFirstProvisional};
        change.index = scene.findType(type)->value;
        return change;
    };
    expectGuarded({create("Script")}, "may not touch Scripts");
    Change url = sets("TEXTURE", "url", kUrls);
    url.node = NodeId{mirror::kFirstProvisional};
    expectGuarded({create("ImageTexture"), url}, "ImageTexture.url");
    EXPECT_EQ(refusal({create("ImageTexture")}, MirrorUpstream::edits), "");
}

/// Two changes that are harmless each for itself: a route to a node, then one from there to a url.
TEST_F(CodeGuard, AWayMadeInOneRequest) {
    expectGuarded({routes("BACK", "bindTime", "CLIP", "startTime"), routes("WAY", "parameter", "NOTE", "parameter")},
                  "Inline.url");
    expectGuarded({sets("WAY", "parameter", kUrls), routes("WAY", "parameter", "MODEL", "source")}, "Inline.url");
}

TEST_F(CodeGuard, WhatHasNothingToDoWithItGoesOn) {
    EXPECT_EQ(refusal({sets("DOOR", "set_open", true, true)}, MirrorUpstream::events), "");
    EXPECT_EQ(refusal({sets("WAY", "parameter", kUrls, true)}, MirrorUpstream::events), "");
    EXPECT_EQ(refusal({sets("BOX", "translation", Vec3f(1, 2, 3))}, MirrorUpstream::edits), "");
    EXPECT_EQ(refusal({routes("BOX", "bboxDisplay", "DOOR", "set_open")}, MirrorUpstream::edits), "");
    // A request of many changes is walked once, and an earlier answer stays right.
    std::vector<Change> many(2000, sets("WAY", "parameter", kUrls, true));
    many.push_back(sets("NOTE", "parameter", kUrls, true));
    many.push_back(sets("NOTE", "parameter", kUrls, true));
    EXPECT_NE(refusal(many, MirrorUpstream::events).find("Inline.url"), std::string::npos);
}

TEST(MirrorKeys, NameThePermissions) {
    EXPECT_EQ(mirrorUpstreamFromName("code"), MirrorUpstream::code);
    EXPECT_EQ(mirrorUpstreamFromName("edits"), MirrorUpstream::edits);
    EXPECT_FALSE(mirrorUpstreamFromName("everything"));
}

}  // namespace
}  // namespace rtsg
