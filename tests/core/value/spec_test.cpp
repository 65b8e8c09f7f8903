// The built-in tables: handles, inheritance, defaults, ranges, aspects and tags.
#include <rtsg/core/spec_table.h>
#include <rtsg/core/x3d.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

using namespace rtsg;

namespace {

const FieldDef& fieldOf(std::string_view type, std::string_view name) {
    const NodeType* found = findBuiltinType(type);
    EXPECT_NE(found, nullptr) << type;
    const FieldIndex index = found ? found->findExact(name) : kNoField;
    EXPECT_NE(index, kNoField) << type << '.' << name;
    static const FieldDef none;
    return index == kNoField ? none : found->fields[index];
}

}  // namespace

TEST(Spec, HandlesAgreeWithTheTable) {
    const auto check = [](TypeIndex type, std::string_view name, FieldIndex field, FieldType fieldType) {
        ASSERT_LT(type.value, builtinTypes().size());
        const NodeType& node = *builtinTypes()[type.value];
        ASSERT_LT(field, node.fields.size());
        EXPECT_EQ(node.fields[field].name, name) << node.name;
        EXPECT_EQ(node.fields[field].type, fieldType) << node.name;
    };
    using namespace x3d;
    check(Transform::type, "translation", Transform::translation.index, FieldType::SFVec3f);
    check(Transform::type, "children", Transform::children.index, FieldType::MFNode);
    check(Coordinate::type, "point", Coordinate::point.index, FieldType::MFVec3f);
    check(x3d::Color::type, "color", x3d::Color::color.index, FieldType::MFColor);
    check(NavigationInfo::type, "type", NavigationInfo::type_.index, FieldType::MFString);
    check(RigidBody::type, "inertia", RigidBody::inertia.index, FieldType::SFMatrix3f);
    check(RtsgScene::type, "children", RtsgScene::children.index, FieldType::MFNode);
    static_assert(std::is_same_v<decltype(IndexedFaceSet::coordIndex), const Field<Array<std::int32_t>>>);
    EXPECT_EQ(builtinTypes()[Shape::type.value]->name, Shape::typeName);
}

TEST(Spec, EveryTypeIsFoundByName) {
    std::set<std::string_view> names;
    for (const auto& type : builtinTypes()) {
        EXPECT_TRUE(names.insert(type->name).second) << type->name;
        EXPECT_EQ(findBuiltinType(type->name), type.get());
        EXPECT_FALSE(isAbstractType(type->name)) << type->name;
        for (const std::string& abstract : type->implements) EXPECT_TRUE(isAbstractType(abstract)) << abstract;
    }
    EXPECT_EQ(names.size(), 267u);  // the 265 of X3D 4.1, RtsgScene and FetchedFile
    EXPECT_EQ(findBuiltinType("X3DNode"), nullptr);
    EXPECT_EQ(findBuiltinType(""), nullptr);
    EXPECT_TRUE(isAbstractType("X3DBoundedObject"));
    EXPECT_FALSE(isAbstractType("X3DNoSuchNode"));
}

TEST(Spec, SaysSinceWhichVersionThereIsWhat) {
    const auto since = [](std::string_view type) { return int{findBuiltinType(type)->since}; };
    EXPECT_EQ(since("Transform"), 20);
    EXPECT_EQ(since("Rectangle2D"), 30);
    EXPECT_EQ(since("CADPart"), 31);
    EXPECT_EQ(since("ClipPlane"), 32);
    EXPECT_EQ(since("PositionDamper2D"), 32);
    EXPECT_EQ(since("ProjectionVolumeStyle"), 33);
    EXPECT_EQ(since("PhysicalMaterial"), 40);
    EXPECT_EQ(since("EnvironmentLight"), 41);
    const auto field = [](std::string_view type, std::string_view name) { return int{fieldOf(type, name).since}; };
    EXPECT_EQ(field("Transform", "translation"), 20);
    EXPECT_EQ(field("Transform", "metadata"), 30);
    EXPECT_EQ(field("Transform", "visible"), 40);
    EXPECT_EQ(field("CADLayer", "visible"), 31) << "it had one before other nodes did";
    EXPECT_EQ(field("Inline", "load"), 30);
    EXPECT_EQ(field("ImageTexture", "load"), 40);
    EXPECT_EQ(field("Anchor", "description"), 20);
    EXPECT_EQ(field("IndexedFaceSet", "tangent"), 41);
    EXPECT_EQ(field("EnvironmentLight", "color"), 41) << "a field is never older than its node";
}

TEST(Spec, DefaultsOfEveryKind) {
    EXPECT_EQ(fieldOf("Transform", "scale").defaultValue, Value(Vec3f(1, 1, 1)));
    EXPECT_EQ(fieldOf("Viewpoint", "fieldOfView").defaultValue, Value(0.7854f));
    EXPECT_EQ(fieldOf("GeoViewpoint", "position").defaultValue, Value(Vec3d(0, 0, 100000)));
    EXPECT_EQ(fieldOf("Extrusion", "spine").defaultValue, Value(Array<Vec3f>{{0, 0, 0}, {0, 1, 0}}));
    EXPECT_EQ(fieldOf("NavigationInfo", "type").defaultValue, Value(Array<String>{"EXAMINE", "ANY"}));
    EXPECT_EQ(fieldOf("Appearance", "alphaMode").defaultValue, Value(String("AUTO")));
    EXPECT_EQ(fieldOf("TimeSensor", "enabled").defaultValue, Value(true));
    EXPECT_EQ(fieldOf("TimeSensor", "cycleInterval").defaultValue, Value(Time{1}));
    EXPECT_EQ(fieldOf("SphereSensor", "offset").defaultValue, Value(Rotation{0, 1, 0, 0}));
    EXPECT_EQ(fieldOf("Extrusion", "orientation").defaultValue, Value(Array<Rotation>{{0, 0, 1, 0}}));
    EXPECT_EQ(fieldOf("TextureTransformMatrix3D", "matrix").defaultValue, Value(Matrix4f()));
    EXPECT_EQ(fieldOf("PixelTexture", "image").defaultValue.as<Image>().words, (Array<std::int32_t>{0, 0, 0}));
    EXPECT_EQ(fieldOf("Material", "diffuseColor").defaultValue, Value(rtsg::Color{0.8f, 0.8f, 0.8f}));
    EXPECT_EQ(fieldOf("TextureProperties", "borderColor").defaultValue, Value(rtsg::ColorRGBA{0, 0, 0, 0}));
    EXPECT_EQ(fieldOf("Shape", "geometry").defaultValue, Value(NodeId{}));
    EXPECT_EQ(fieldOf("Switch", "whichChoice").defaultValue, Value(std::int32_t{-1}));
}

TEST(Spec, InheritanceIsTransitive) {
    const NodeType& transform = *findBuiltinType("Transform");
    for (const char* base : {"X3DGroupingNode", "X3DChildNode", "X3DNode", "X3DBoundedObject"})
        EXPECT_TRUE(transform.isA(base)) << base;
    EXPECT_FALSE(transform.isA("X3DShapeNode"));
    const NodeType& movie = *findBuiltinType("MovieTexture");
    for (const char* base : {"X3DSoundSourceNode", "X3DTexture2DNode", "X3DUrlObject", "X3DTimeDependentNode"})
        EXPECT_TRUE(movie.isA(base)) << base;
}

TEST(Spec, AspectsSayWhatChanges) {
    const auto aspect = [](std::string_view type, std::string_view name) { return fieldOf(type, name).aspect; };
    EXPECT_EQ(aspect("Transform", "translation"), Aspect::transform);
    EXPECT_EQ(aspect("Transform", "children"), Aspect::structure);
    EXPECT_EQ(aspect("Transform", "visible"), Aspect::structure);
    EXPECT_EQ(aspect("Switch", "whichChoice"), Aspect::structure);
    EXPECT_EQ(aspect("Coordinate", "point"), Aspect::geometry);
    EXPECT_EQ(aspect("Material", "diffuseColor"), Aspect::appearance);
    EXPECT_EQ(aspect("Appearance", "material"), Aspect::structure);
    EXPECT_EQ(aspect("AcousticProperties", "absorption"), Aspect::sound);
    EXPECT_EQ(aspect("AudioClip", "url"), Aspect::sound);
    EXPECT_EQ(aspect("AudioClip", "startTime"), Aspect::sound);
    EXPECT_EQ(aspect("TimeSensor", "startTime"), Aspect::time);
    EXPECT_EQ(aspect("TimeSensor", "isActive"), Aspect::time);
    EXPECT_EQ(aspect("Inline", "url"), Aspect::structure);
    EXPECT_EQ(aspect("ImageTexture", "url"), Aspect::appearance);
    EXPECT_EQ(aspect("PointLight", "location"), Aspect::light);
    EXPECT_EQ(aspect("Viewpoint", "set_bind"), Aspect::view);
    EXPECT_EQ(aspect("WorldInfo", "metadata"), Aspect::none);
    // Every link to a node that is not metadata changes the graph.
    for (const auto& type : builtinTypes())
        for (const FieldIndex i : type->nodeFields()) {
            const FieldDef& field = type->fields[i];
            if (field.hidden && field.name.starts_with('_')) continue;  // stacks and the like only point
            const bool metadata = field.name == "metadata" || type->name == "MetadataSet";
            EXPECT_EQ(field.aspect, metadata ? Aspect::none : Aspect::structure) << type->name << '.' << field.name;
        }
}

TEST(Spec, TagsSayWhatActsAndWhatHasAPlace) {
    const auto type = [](std::string_view name) -> const NodeType& { return *findBuiltinType(name); };
    const auto below = [&](std::string_view name) {
        std::string names;
        for (const FieldIndex field : type(name).below) names += type(name).fields[field].name + ' ';
        return names;
    };
    for (const char* always :
         {"TimeSensor", "TouchSensor", "Viewpoint", "PositionDamper", "Script", "AudioClip", "LOD"})
        EXPECT_EQ(type(always).acts, Acts::always) << always;
    for (const char* onInput : {"PositionInterpolator", "BooleanFilter", "BooleanToggle", "IntegerTrigger", "Inline"})
        EXPECT_EQ(type(onInput).acts, Acts::onInput) << onInput;
    for (const char* never : {"Transform", "IndexedFaceSet", "PointLight", "CollisionCollection"})
        EXPECT_EQ(type(never).acts, Acts::never) << never;
    for (const char* writes :
         {"Script", "BooleanToggle", "EspduTransform", "MotorJoint", "CollisionSensor", "TimeSensor", "RigidBody"})
        EXPECT_TRUE(type(writes).writesInputs) << writes;
    for (const char* other : {"TouchSensor", "PositionInterpolator", "Inline", "LoadSensor"})
        EXPECT_FALSE(type(other).writesInputs) << other;

    EXPECT_EQ(type("Transform").role, "group");
    EXPECT_EQ(below("Transform"), "children ");
    EXPECT_EQ(type("Switch").role, "choice");
    EXPECT_EQ(below("LayerSet"), "layers ");
    EXPECT_EQ(below("HAnimHumanoid"), "skeleton skin viewpoints ");
    EXPECT_EQ(type("Inline").below, std::vector{type("Inline").body()});
    EXPECT_EQ(type("SpotLight").role, "light");
    EXPECT_EQ(type("GeoProximitySensor").role, "sensor");
    EXPECT_EQ(type("ParticleSystem").role, "shape");
    for (const char* volume : {"VolumeData", "SegmentedVolumeData", "IsoSurfaceVolumeData"})
        EXPECT_EQ(type(volume).role, "shape");
    EXPECT_EQ(type("Material").role, "");
    const auto groups = builtinGroupTypes();
    EXPECT_TRUE((std::ranges::find(groups, "X3DGroupingNode") != groups.end()));
    EXPECT_TRUE((std::ranges::find(groups, "LOD") != groups.end()));
    EXPECT_FALSE((std::ranges::find(groups, "Transform") != groups.end())) << "inherits it";
}

TEST(Spec, HiddenFieldsComeLastAndAreNotFound) {
    const NodeType& sensor = *findBuiltinType("TimeSensor");
    EXPECT_EQ(sensor.find("_cycleStart"), kNoField);
    EXPECT_EQ(sensor.findExact("_cycleStart"), x3d::TimeSensor::_cycleStart.index);
    EXPECT_EQ(findBuiltinType("Inline")->find("set_body"), kNoField);
    for (const auto& type : builtinTypes()) {
        bool hidden = false;
        for (const FieldDef& field : type->fields) {
            EXPECT_GE(field.hidden, hidden) << type->name << '.' << field.name;
            hidden = field.hidden;
            if (hidden) {
                EXPECT_EQ(field.access, Access::inputOutput);
            }
        }
    }
    EXPECT_TRUE(findBuiltinType("RtsgScene")->internal);
    EXPECT_FALSE(findBuiltinType("Group")->internal);
}

TEST(Spec, RangesCountEveryComponent) {
    const FieldDef& color = fieldOf("Material", "diffuseColor");
    EXPECT_TRUE(color.inRange(rtsg::Color{0, 0.5f, 1}));
    EXPECT_FALSE(color.inRange(rtsg::Color{0, 0.5f, 1.001f}));
    const FieldDef& colors = fieldOf("Color", "color");
    EXPECT_TRUE(colors.inRange(Array<rtsg::Color>{}));
    EXPECT_FALSE(colors.inRange(Array<rtsg::Color>{{0, 0, 0}, {0, 0, -0.1f}}));
    const FieldDef& radius = fieldOf("Sphere", "radius");
    EXPECT_TRUE(radius.inRange(0.001f));
    EXPECT_FALSE(radius.inRange(0.f));
    EXPECT_FALSE(radius.inRange(std::numeric_limits<float>::quiet_NaN()));
    const FieldDef& cutOff = fieldOf("SpotLight", "cutOffAngle");
    EXPECT_TRUE(cutOff.inRange(1.5708f));
    EXPECT_TRUE(cutOff.inRange(1.571f));
    EXPECT_FALSE(cutOff.inRange(1.6f));
    EXPECT_FALSE(fieldOf("Viewpoint", "fieldOfView").inRange(3.2f));
    const FieldDef& index = fieldOf("IndexedFaceSet", "coordIndex");
    EXPECT_TRUE(index.inRange(Array<std::int32_t>{0, 1, 2, -1}));
    EXPECT_FALSE(index.inRange(Array<std::int32_t>{0, 1, 2, -2}));
    EXPECT_TRUE(fieldOf("MetadataBoolean", "value").inRange(Array<bool>{true}));
    EXPECT_TRUE(fieldOf("Transform", "translation").inRange(Vec3f(-1e30f, 0, 0)));
    // The standard's own defaults are in range.
    for (const auto& type : builtinTypes())
        for (const FieldDef& field : type->fields)
            if (field.access == Access::inputOutput || field.access == Access::initializeOnly) {
                EXPECT_TRUE(field.inRange(field.defaultValue)) << type->name << '.' << field.name;
            }
}

TEST(Spec, BlocksAreSmall) {
    for (const char* name : {"Transform", "Shape", "Group", "Appearance", "Material", "IndexedFaceSet", "TimeSensor",
                             "PositionInterpolator"}) {
        const NodeType& type = *findBuiltinType(name);
        std::printf("%-22s %4zu bytes, %2zu fields\n", name, type.blockSize(), type.fields.size());
        EXPECT_LE(type.blockSize(), 250u) << name;
        std::size_t payload = 0;
        for (const FieldDef& field : type.fields)
            if (field.offset != FieldDef::kNoOffset) payload += info(field.type).size;
        EXPECT_LT(type.blockSize() - payload, 8u) << name << ": padding between fields";
    }
}
