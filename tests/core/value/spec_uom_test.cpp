// Checks the node tables against the X3D Unified Object Models of 4.0 and 4.1, independent statements of the standard,
// where those files lie beside the project: of the tables, what its version has. Where they disagree on purpose,
// `kExceptions` says why.
#include <rtsg/core/field_text.h>
#include <rtsg/core/node_type.h>

#include <expat.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>

#include "test_paths.h"

using namespace rtsg;

namespace {

using Attributes = std::map<std::string, std::string, std::less<>>;

struct UomField {
    Attributes attributes;
    std::vector<std::string> enumeration;
    std::string operator[](std::string_view key) const {
        const auto found = attributes.find(key);
        return found == attributes.end() ? std::string() : found->second;
    }
};
struct UomNode {
    std::string component, containerField;
    int level = 0;
    std::vector<std::string> bases;
    std::map<std::string, UomField> fields;
};

/// The model: concrete nodes and abstract types by name.
class Uom {
  public:
    /// `version` as NodeType::since has it.
    static const Uom& get(int version) {
        static const Uom before("4.0"), now("4.1");
        return version == 40 ? before : now;
    }
    std::map<std::string, UomNode> nodes, abstracts;
    std::string error;

  private:
    explicit Uom(const std::string& version) {
        const char* shared = std::getenv("RTSG_SHARED");
        const std::string folder = shared ? shared : RTSG_SOURCE_DIR "/../shared";
        std::ifstream in(folder + "/reference/X3dUnifiedObjectModel-" + version + ".xml", std::ios::binary);
        const std::string text(std::istreambuf_iterator<char>(in), {});
        if (text.empty()) return;
        const XML_Parser parser = XML_ParserCreate(nullptr);
        XML_SetUserData(parser, this);
        XML_SetElementHandler(parser, &Uom::begin, &Uom::end);
        if (XML_Parse(parser, text.data(), static_cast<int>(text.size()), 1) == XML_STATUS_ERROR)
            error = XML_ErrorString(XML_GetErrorCode(parser));
        XML_ParserFree(parser);
    }

    static void begin(void* self, const char* element, const char** list) {
        Attributes attributes;
        for (; *list; list += 2) attributes[list[0]] = list[1];
        static_cast<Uom*>(self)->begin(element, std::move(attributes));
    }
    static void end(void* self, const char* element) { static_cast<Uom*>(self)->end(element); }

    void begin(const std::string& element, Attributes attributes) {
        if (element == "ConcreteNode") node_ = &nodes[attributes["name"]];
        if (element == "AbstractNodeType" || element == "AbstractObjectType") node_ = &abstracts[attributes["name"]];
        if (!node_) return;
        if (element == "componentInfo" && !field_) {
            node_->component = attributes["name"];
            node_->level = std::stoi(attributes["level"]);
        } else if (element == "Inheritance" || element == "AdditionalInheritance") {
            node_->bases.push_back(attributes["baseType"]);
        } else if (element == "containerField") {
            node_->containerField = attributes["default"];
        } else if (element == "field") {
            const std::string name = attributes["name"];
            field_ = &node_->fields[name];
            field_->attributes = std::move(attributes);
        } else if (element == "enumeration" && field_) {
            field_->enumeration.push_back(attributes["value"]);
        }
    }
    void end(const std::string& element) {
        if (element == "field") field_ = nullptr;
        if (element == "ConcreteNode" || element == "AbstractNodeType" || element == "AbstractObjectType")
            node_ = nullptr;
    }

    UomNode* node_ = nullptr;
    UomField* field_ = nullptr;
};

struct Exception {
    std::string_view node, fields;  // `*` for any node; names separated by a space
    std::string_view what;          // "field", "ours", "default", "range", "allowed", "type"
    std::string_view reason;
    int only = 0;  // the version of the model that it is about; 0: both
};
// Attributes of the XML encoding, and entries of the model that are no node types, are not fields or nodes of
// ISO/IEC 19775-1.
constexpr std::string_view kXmlOnly[] = {"DEF", "USE", "IS", "class", "id", "style"};
constexpr Exception kExceptions[] = {
    {"ProtoInstance", "", "field", "a statement of the XML encoding, not a node type (4.4.4)"},
    {"*", "sourceCode", "field", "the XML encoding's CDATA form of url (19776-1, 4.3.8); the node has url only"},
    {"*", "field", "field", "the XML encoding's form of the interface declarations (29.2, 31.2)"},
    {"*", "style", "allowed", "the node tables of 15.4.1 and 36.4.4 also allow the empty string, for PLAIN"},
    {"ElevationGrid", "tangent", "ours",
     "4.1 says of Tangent that it applies to ElevationGrid too, and lists no such field"},
    {"Fog", "volumetric volumetricDirection volumetricVisibilityStart", "ours",
     "fields of Castle Game Engine, for fog that lies along a direction"},
    {"LocalFog", "volumetric volumetricDirection volumetricVisibilityStart", "ours",
     "fields of Castle Game Engine, for fog that lies along a direction"},
    {"Box", "size", "range", "13.3.1: (0,inf); the model names no bounds"},
    {"Rectangle2D", "size", "range", "14.3.7: (0,inf); the model names no bounds"},
    {"RigidBody",
     "angularDampingFactor disableAngularSpeed disableLinearSpeed finiteRotationAxis linearDampingFactor mass", "range",
     "the node table in 37.4 has bounds, the model none"},
    {"RigidBodyCollection",
     "constantForceMix contactSurfaceThickness disableAngularSpeed disableLinearSpeed errorCorrection iterations",
     "range", "the node table in 37.4 has bounds, the model none"},
    {"SingleAxisHingeJoint", "stopBounce stopErrorCorrection", "range",
     "the node table in 37.4 has bounds, the model none"},
    {"DoubleAxisHingeJoint",
     "maxAngle1 minAngle1 stop1Bounce stop1ConstantForceMix stop1ErrorCorrection suspensionErrorCorrection "
     "suspensionForce",
     "range", "the node table in 37.4 has bounds, the model none"},
    {"SliderJoint", "maxSeparation minSeparation stopBounce stopErrorCorrection", "range",
     "the node table in 37.4 has bounds, the model none"},
    {"MotorJoint",
     "axis1Angle axis2Angle axis3Angle stop1Bounce stop1ErrorCorrection stop2Bounce stop2ErrorCorrection stop3Bounce "
     "stop3ErrorCorrection",
     "range", "the node table in 37.4 has bounds, the model none"},
    {"TextureProjector", "upVector", "default", "4.1 has a direction that is not that of the view", 40},
    {"HAnimHumanoid", "loa", "range", "4.1 has one more level of articulation", 40},
    {"HAnimMotion", "loa", "range", "4.1 has one more level of articulation", 40},
    {"HAnimHumanoid", "version", "allowed", "4.1 knows HAnim 2.1", 40},
    {"StreamAudioDestination", "streamIdentifier", "type", "a list in 4.1", 40},
    {"StreamAudioDestination", "streamIdentifier", "default", "a list in 4.1", 40},
    {"StreamAudioSource", "streamIdentifier", "type", "a list in 4.1", 40},
    {"StreamAudioSource", "streamIdentifier", "default", "a list in 4.1", 40},
};

bool excepted(int version, std::string_view node, std::string_view field, std::string_view what) {
    return std::ranges::any_of(kExceptions, [&](const Exception& e) {
        return (e.only == 0 || e.only == version) && (e.node == "*" || e.node == node) && e.what == what &&
               (" " + std::string(e.fields) + " ").contains(" " + std::string(field) + " ");
    });
}

const char* accessName(Access access) {
    switch (access) {
        case Access::initializeOnly:
            return "initializeOnly";
        case Access::inputOnly:
            return "inputOnly";
        case Access::outputOnly:
            return "outputOnly";
        case Access::inputOutput:
            return "inputOutput";
    }
    return "?";
}

std::vector<std::string> words(const std::string& text) {
    std::istringstream in(text);
    return {std::istream_iterator<std::string>(in), {}};
}

std::vector<std::string> quoted(const std::string& text) {
    std::vector<std::string> result;
    for (std::size_t i = text.find('"'); i != std::string::npos;) {
        const std::size_t end = text.find('"', i + 1);
        result.push_back(text.substr(i + 1, end - i - 1));
        i = text.find('"', end + 1);
    }
    return result;
}

/// The strings the model allows in a field, if it closes the list. For MF fields it lists whole values: the single
/// strings are what may occur.
std::set<std::string> allowedStrings(const UomField& field, bool many) {
    std::set<std::string> values;
    if (field["additionalEnumerationValuesAllowed"] != "false") return values;
    for (const std::string& value : field.enumeration) {
        if (!many)
            values.insert(value);
        else
            for (const std::string& part : quoted(value)) values.insert(part);
    }
    return values;
}

/// The model lists the nodes of the audio graph one by one, which is every X3DSoundNode but PeriodicWave.
bool isSoundNodeList(const UomField& field) {
    return field["acceptableNodeTypes"].starts_with("Analyser|AudioClip|");
}

std::string joined(const std::vector<std::string>& parts) {
    std::string result;
    for (const std::string& part : parts) result += (result.empty() ? "" : "|") + part;
    return result;
}

template <class S>
void appendNumbers(std::vector<double>& result, const void* data, std::size_t count) {
    const S* numbers = static_cast<const S*>(data);
    for (std::size_t i = 0; i < count; ++i) result.push_back(static_cast<double>(numbers[i]));
}

/// The numbers of any numeric value, one after the other.
std::vector<double> numbersOf(const Value& value) {
    std::vector<double> result;
    switch (value.type()) {
#define RTSG_X(suffix, T)                                                                 \
    case FieldType::SF##suffix:                                                           \
    case FieldType::MF##suffix:                                                           \
        if constexpr (std::is_trivially_copyable_v<T> && !std::is_same_v<T, NodeId>) {    \
            const bool many = isMF(value.type());                                         \
            const T* first = many ? value.as<Array<T>>().data() : &value.as<T>();         \
            const std::size_t count = many ? value.as<Array<T>>().size() : 1;             \
            const std::string_view name = #suffix;                                        \
            if (name == "Bool")                                                           \
                appendNumbers<bool>(result, first, count);                                \
            else if (name == "Int32")                                                     \
                appendNumbers<std::int32_t>(result, first, count);                        \
            else if (name.ends_with('d') || name == "Double" || name == "Time")           \
                appendNumbers<double>(result, first, count * sizeof(T) / sizeof(double)); \
            else                                                                          \
                appendNumbers<float>(result, first, count * sizeof(T) / sizeof(float));   \
        }                                                                                 \
        break;
        RTSG_FIELD_TYPES(RTSG_X)
#undef RTSG_X
    }
    return result;
}

void expectDefault(const FieldDef& field, const std::string& text, const std::string& where) {
    const Value& value = field.defaultValue;
    switch (field.type) {
        case FieldType::SFString:
            EXPECT_EQ(value.as<String>().view(), text) << where;
            return;
        case FieldType::MFString: {
            std::vector<std::string> ours;
            for (const String& s : value.as<Array<String>>()) ours.push_back(s.str());
            EXPECT_EQ(ours, quoted(text)) << where;
            return;
        }
        case FieldType::SFNode:
            EXPECT_EQ(text, "NULL") << where;
            EXPECT_FALSE(value.as<NodeId>()) << where;
            return;
        case FieldType::MFNode:
            EXPECT_EQ(text, "") << where;
            EXPECT_TRUE(value.as<Array<NodeId>>().empty()) << where;
            return;
        case FieldType::SFImage: {
            std::vector<std::string> ours;
            for (const std::int32_t word : value.as<Image>().words) ours.push_back(std::to_string(word));
            EXPECT_EQ(ours, words(text)) << where;
            return;
        }
        default:
            break;
    }
    std::vector<double> theirs;
    for (const std::string& word : words(text))
        theirs.push_back(word == "true" ? 1 : word == "false" ? 0 : std::stod(word));
    const std::vector<double> ours = numbersOf(value);
    ASSERT_EQ(ours.size(), theirs.size()) << where;
    for (std::size_t i = 0; i < ours.size(); ++i) EXPECT_NEAR(ours[i], theirs[i], 1e-6) << where << " [" << i << ']';
}

/// Calls check(type, field, uomField, "Node.field") for every field that both sides have.
template <class Check>
void forEachField(int version, Check check) {
    for (const auto& [name, node] : Uom::get(version).nodes) {
        const NodeType* type = findBuiltinType(name);
        if (!type) continue;
        for (const auto& [fieldName, theirs] : node.fields) {
            const FieldIndex index = type->findExact(fieldName);
            if (index == kNoField || type->fields[index].hidden || type->fields[index].since > version) continue;
            check(*type, type->fields[index], theirs, name + '.' + fieldName);
        }
    }
}

class SpecUom : public testing::TestWithParam<int> {
  protected:
    void SetUp() override {
        ASSERT_EQ(Uom::get(GetParam()).error, "");
        if (Uom::get(GetParam()).nodes.empty())
            GTEST_SKIP() << "no ../shared/reference/X3dUnifiedObjectModel-4.x.xml beside the project to check against";
    }
};

INSTANTIATE_TEST_SUITE_P(Models, SpecUom, testing::Values(40, 41),
                         [](const auto& param) { return "X3d" + std::to_string(param.param); });

}  // namespace

TEST_P(SpecUom, SameNodesInSameComponents) {
    std::set<std::string> theirs;
    for (const auto& [name, node] : Uom::get(GetParam()).nodes) {
        if (excepted(GetParam(), name, "", "field")) continue;
        theirs.insert(name);
        const NodeType* type = findBuiltinType(name);
        ASSERT_NE(type, nullptr) << name;
        EXPECT_EQ(type->component, node.component) << name;
        EXPECT_EQ(type->level, node.level) << name;
        EXPECT_EQ(type->containerField, node.containerField) << name;
    }
    for (const auto& type : builtinTypes()) {
        if (!type->internal) {
            EXPECT_EQ(theirs.contains(type->name), type->since <= GetParam()) << type->name;
        }
    }
    EXPECT_EQ(theirs.size(), GetParam() == 40 ? 259u : 265u);
}

TEST_P(SpecUom, SameInheritance) {
    for (const auto& [name, node] : Uom::get(GetParam()).nodes) {
        const NodeType* type = findBuiltinType(name);
        if (!type) continue;
        std::set<std::string> theirs;
        std::vector<std::string> open = node.bases;
        while (!open.empty()) {
            const std::string base = open.back();
            open.pop_back();
            if (base.empty() || !theirs.insert(base).second) continue;
            const auto found = Uom::get(GetParam()).abstracts.find(base);
            ASSERT_NE(found, Uom::get(GetParam()).abstracts.end()) << base;
            open.insert(open.end(), found->second.bases.begin(), found->second.bases.end());
        }
        // A hole of the 4.0 model: MultiTextureTransform would take none of them. 4.1 has it.
        if (GetParam() == 40 && name.starts_with("TextureTransform")) theirs.insert("X3DSingleTextureTransformNode");
        // In both models: no material and no MultiTexture would take them; MultiTexture of 3.3 did (18.4.3).
        if (theirs.contains("X3DTexture3DNode") || theirs.contains("X3DEnvironmentTextureNode"))
            theirs.insert("X3DSingleTextureNode");
        EXPECT_EQ(std::set<std::string>(type->implements.begin(), type->implements.end()), theirs) << name;
    }
}

TEST_P(SpecUom, SameFieldsOfSameTypeAndAccess) {
    std::size_t fields = 0;
    for (const auto& [name, node] : Uom::get(GetParam()).nodes) {
        const NodeType* type = findBuiltinType(name);
        if (!type) continue;
        std::set<std::string> theirs;
        for (const auto& [fieldName, field] : node.fields) {
            const bool xmlOnly = std::ranges::find(kXmlOnly, fieldName) != std::end(kXmlOnly);
            // But FontStyle has a style of its own.
            if (xmlOnly && (fieldName == "IS" || field["inheritedFrom"] == "X3DNode")) continue;
            if (excepted(GetParam(), name, fieldName, "field")) continue;
            theirs.insert(fieldName);
        }
        std::set<std::string> ours;
        for (const FieldDef& field : type->fields)
            if (!field.hidden && field.since <= GetParam() && !excepted(GetParam(), name, field.name, "ours"))
                ours.insert(field.name);
        EXPECT_EQ(ours, theirs) << name;
        fields += ours.size();
    }
    EXPECT_GT(fields, 2500u);
    forEachField(GetParam(),
                 [](const NodeType& node, const FieldDef& ours, const UomField& theirs, const std::string& where) {
                     // The model has one field of a type of XML Schema's.
                     const std::string type = theirs["type"] == "xs:NMTOKEN" ? "SFString" : theirs["type"];
                     if (!excepted(GetParam(), node.name, ours.name, "type")) {
                         EXPECT_EQ(info(ours.type).name, type) << where;
                     }
                     EXPECT_EQ(accessName(ours.access), theirs["accessType"]) << where;
                 });
}

TEST_P(SpecUom, SameDefaults) {
    forEachField(GetParam(),
                 [](const NodeType& type, const FieldDef& ours, const UomField& theirs, const std::string& where) {
                     if (ours.access == Access::inputOnly || ours.access == Access::outputOnly) {
                         EXPECT_EQ(theirs["default"], "") << where;
                     } else if (!excepted(GetParam(), type.name, ours.name, "default")) {
                         expectDefault(ours, theirs["default"], where);
                     }
                 });
}

TEST_P(SpecUom, SameRanges) {
    std::size_t bounded = 0;
    forEachField(GetParam(),
                 [&](const NodeType& type, const FieldDef& ours, const UomField& theirs, const std::string& where) {
                     if (excepted(GetParam(), type.name, ours.name, "range")) return;
                     const auto bound = [&](std::string_view inclusive, std::string_view exclusive, double none,
                                            double value, bool isExclusive) {
                         const std::string text = theirs[inclusive].empty() ? theirs[exclusive] : theirs[inclusive];
                         if (text.empty()) {
                             EXPECT_EQ(value, none) << where << ' ' << inclusive;
                             return;
                         }
                         ++bounded;
                         // The model writes multiples of pi with four to six decimals.
                         EXPECT_NEAR(value, std::stod(text), std::abs(value) * 1e-4) << where << ' ' << inclusive;
                         EXPECT_EQ(isExclusive, !theirs[exclusive].empty()) << where << ' ' << exclusive;
                     };
                     constexpr double inf = std::numeric_limits<double>::infinity();
                     bound("minInclusive", "minExclusive", -inf, ours.min, ours.exclusiveMin);
                     bound("maxInclusive", "maxExclusive", inf, ours.max, ours.exclusiveMax);
                 });
    EXPECT_GT(bounded, 500u);
}

TEST_P(SpecUom, SameAllowedStringsAndAcceptedNodes) {
    std::size_t allowed = 0, accepting = 0;
    forEachField(
        GetParam(), [&](const NodeType& type, const FieldDef& ours, const UomField& theirs, const std::string& where) {
            if (sf(ours.type) == FieldType::SFString && !excepted(GetParam(), type.name, ours.name, "allowed")) {
                const std::set<std::string> values = allowedStrings(theirs, isMF(ours.type));
                EXPECT_EQ(std::set<std::string>(ours.allowed.begin(), ours.allowed.end()), values) << where;
                allowed += !values.empty();
            }
            if (sf(ours.type) == FieldType::SFNode) {
                if (isSoundNodeList(theirs)) {
                    EXPECT_EQ(ours.accepts, std::vector<std::string>{"X3DSoundNode"}) << where;
                } else {
                    EXPECT_EQ(joined(ours.accepts), theirs["acceptableNodeTypes"]) << where;
                }
                ++accepting;
            }
        });
    EXPECT_GT(allowed, 50u);
    EXPECT_GT(accepting, 600u);
}

TEST(SpecUomExceptions, EachIsNeeded) {
    if (Uom::get(40).nodes.empty() || Uom::get(41).nodes.empty())
        GTEST_SKIP() << "no ../shared/reference/X3dUnifiedObjectModel-4.x.xml beside the project to check against";
    const auto needed = [](const Exception& e, std::string_view fieldName, int version) {
        for (const auto& [name, node] : Uom::get(version).nodes) {
            if (e.node != "*" && e.node != name) continue;
            const NodeType* type = findBuiltinType(name);
            if (!type && fieldName.empty()) return true;
            if (!type) continue;
            const auto theirs = node.fields.find(std::string(fieldName));
            if (e.what == "ours" && theirs == node.fields.end() && type->findExact(fieldName) != kNoField) return true;
            if (theirs == node.fields.end()) continue;
            const FieldIndex index = type->findExact(fieldName);
            if (e.what == "field" && index == kNoField) return true;
            if (index == kNoField) continue;
            const FieldDef& ours = type->fields[index];
            if (e.what == "allowed" && std::set<std::string>(ours.allowed.begin(), ours.allowed.end()) !=
                                           allowedStrings(theirs->second, isMF(ours.type)))
                return true;
            if (e.what == "type" && theirs->second["type"] != info(ours.type).name) return true;
            if (e.what == "default" && theirs->second["default"] != printFieldText(ours.defaultValue)) return true;
            const auto& attributes = theirs->second.attributes;
            if (e.what == "range" && attributes.contains("maxInclusive") &&
                std::stod(theirs->second["maxInclusive"]) != ours.max)
                return true;
            if (e.what == "range" && ours.bounded() && !attributes.contains("minInclusive") &&
                !attributes.contains("minExclusive"))
                return true;
        }
        return false;
    };
    for (const Exception& e : kExceptions) {
        std::vector<std::string> names = words(std::string(e.fields));
        if (names.empty()) names.emplace_back();
        for (const std::string& name : names)
            EXPECT_TRUE(needed(e, name, e.only ? e.only : 40) || (e.only == 0 && needed(e, name, 41)))
                << e.node << '.' << name << ' ' << e.what;
    }
}
