// The JSON Schemas of the topics for viewers.
#include "viewers/message_schemas.h"

#include <initializer_list>
#include <utility>

#include <fmt/format.h>

namespace rtsg {

namespace {

using Property = std::pair<const char*, std::string>;

std::string object(const char* title, std::initializer_list<Property> properties) {
    std::string list;
    for (const auto& [name, schema] : properties)
        list += fmt::format("{}\"{}\":{}", list.empty() ? "" : ",", name, schema);
    return fmt::format(R"({{"title":"{}","type":"object","properties":{{{}}}}})", title, list);
}
std::string arrayOf(const std::string& items) {
    return fmt::format(R"({{"type":"array","items":{}}})", items);
}

const std::string kNumber = R"({"type":"number"})", kInteger = R"({"type":"integer"})", kText = R"({"type":"string"})",
                  kFlag = R"({"type":"boolean"})";

std::string moment(const char* title) {
    return object(title, {{"sec", kInteger}, {"nsec", kInteger}});
}
std::string vector(const char* title) {
    return object(title, {{"x", kNumber}, {"y", kNumber}, {"z", kNumber}});
}
std::string quaternion() {
    return object("foxglove.Quaternion", {{"x", kNumber}, {"y", kNumber}, {"z", kNumber}, {"w", kNumber}});
}
std::string poseSchema() {
    return object("foxglove.Pose", {{"position", vector("foxglove.Vector3")}, {"orientation", quaternion()}});
}
std::string color() {
    return object("foxglove.Color", {{"r", kNumber}, {"g", kNumber}, {"b", kNumber}, {"a", kNumber}});
}
std::string solid(const char* title) {
    return object(title, {{"pose", poseSchema()}, {"size", vector("foxglove.Vector3")}, {"color", color()}});
}

}  // namespace

std::string frameTransformsSchema() {
    const std::string transform = object("foxglove.FrameTransform", {{"timestamp", moment("time")},
                                                                     {"parent_frame_id", kText},
                                                                     {"child_frame_id", kText},
                                                                     {"translation", vector("foxglove.Vector3")},
                                                                     {"rotation", quaternion()}});
    return object("foxglove.FrameTransforms", {{"transforms", arrayOf(transform)}});
}

std::string sceneUpdateSchema() {
    const std::string deletion =
        object("foxglove.SceneEntityDeletion", {{"timestamp", moment("time")}, {"type", kInteger}, {"id", kText}});
    const std::string cylinder = object("foxglove.CylinderPrimitive", {{"pose", poseSchema()},
                                                                       {"size", vector("foxglove.Vector3")},
                                                                       {"bottom_scale", kNumber},
                                                                       {"top_scale", kNumber},
                                                                       {"color", color()}});
    const std::string triangles =
        object("foxglove.TriangleListPrimitive", {{"pose", poseSchema()},
                                                  {"points", arrayOf(vector("foxglove.Point3"))},
                                                  {"color", color()},
                                                  {"colors", arrayOf(color())},
                                                  {"indices", arrayOf(kInteger)}});
    const std::string pair = object("foxglove.KeyValuePair", {{"key", kText}, {"value", kText}});
    const std::string entity = object("foxglove.SceneEntity", {{"timestamp", moment("time")},
                                                               {"frame_id", kText},
                                                               {"id", kText},
                                                               {"lifetime", moment("duration")},
                                                               {"frame_locked", kFlag},
                                                               {"metadata", arrayOf(pair)},
                                                               {"cubes", arrayOf(solid("foxglove.CubePrimitive"))},
                                                               {"spheres", arrayOf(solid("foxglove.SpherePrimitive"))},
                                                               {"cylinders", arrayOf(cylinder)},
                                                               {"triangles", arrayOf(triangles)}});
    return object("foxglove.SceneUpdate", {{"deletions", arrayOf(deletion)}, {"entities", arrayOf(entity)}});
}

std::string changesSchema() {
    const std::string change = object("rtsg.Change", {{"kind", kText},
                                                      {"id", kInteger},
                                                      {"node", kText},
                                                      {"type", kText},
                                                      {"field", kText},
                                                      {"value", "{}"},
                                                      {"other", kInteger},
                                                      {"index", kInteger},
                                                      {"external", kFlag}});
    return object(
        "rtsg.Changes",
        {{"frame", kInteger}, {"from", kInteger}, {"t", kNumber}, {"hash", kText}, {"changes", arrayOf(change)}});
}

std::string fieldSchema(FieldType type) {
    const std::string name(info(type).name);
    const bool isList = name.starts_with("MF");
    const std::string element = name.substr(2);
    std::string one;
    if (element == "Float" || element == "Double" || element == "Time")
        one = kNumber;
    else if (element == "Int32")
        one = kInteger;
    else if (element == "Bool")
        one = kFlag;
    else if (element == "String")
        one = kText;
    else if (!isList && element != "Node" && element != "Image")
        one = arrayOf(kNumber);
    if (!one.empty() && isList) one = arrayOf(one);
    const std::string title = "rtsg." + name;
    // Viewers refuse schemas of arrays in arrays; without one the value is shown as it is.
    if (one.empty()) return object(title.c_str(), {{"timestamp", moment("time")}});
    return object(title.c_str(), {{"timestamp", moment("time")}, {"value", one}});
}

}  // namespace rtsg
