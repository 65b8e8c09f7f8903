// Makes OGRE's materials and textures of this library's.
#include "gpu_material.h"

#include <algorithm>
#include <stdexcept>

#include <OgreHardwarePixelBuffer.h>
#include <OgreHighLevelGpuProgram.h>
#include <OgreHighLevelGpuProgramManager.h>
#include <OgreMaterialManager.h>
#include <OgrePass.h>
#include <OgreTechnique.h>
#include <OgreTextureManager.h>

namespace rtsg {

namespace {

const Ogre::String& group() {
    return Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME;
}

Ogre::TextureAddressingMode wrapOf(RasterWrap wrap) {
    switch (wrap) {
        case RasterWrap::mirror:
            return Ogre::TAM_MIRROR;
        case RasterWrap::clamp:
            return Ogre::TAM_CLAMP;
        case RasterWrap::border:
            return Ogre::TAM_BORDER;
        case RasterWrap::repeat:
            break;
    }
    return Ogre::TAM_WRAP;
}

/// The names by which programs know DrawNumbers.
const char* const kDrawNumbers[] = {"thing",       "stroke",  "attenuation", "named",     "eyePlace", "eyeForward",
                                    "eyeRight",    "eyeUp",   "eyeLimits",   "eyePixels", "eyeMore",  "eyeEdges",
                                    "pictureSize", "squareX", "squareY",     "squareZ"};
static_assert(std::size(kDrawNumbers) == static_cast<std::size_t>(DrawNumber::count));

/// A program of one kind, made once in the process.
Ogre::GpuProgramPtr program(const std::string& name, Ogre::GpuProgramType type, const std::string& source) {
    auto& programs = Ogre::HighLevelGpuProgramManager::getSingleton();
    if (auto known = programs.getByName(name, group())) return known;
    auto created = programs.createProgram(name, group(), "glsl", type);
    created->setSource(source);
    created->load();
    return created;
}

/// Without `ignore` a number that a program does not use would be an error.
void bindNumbers(const Ogre::GpuProgramParametersSharedPtr& parameters) {
    using P = Ogre::GpuProgramParameters;
    parameters->setIgnoreMissingParams(true);
    parameters->setNamedAutoConstant("world", P::ACT_WORLD_MATRIX);
    parameters->setNamedAutoConstant("viewProjection", P::ACT_VIEWPROJ_MATRIX);
    parameters->setNamedAutoConstant("projection", P::ACT_PROJECTION_MATRIX);
    for (std::size_t i = 0; i < std::size(kDrawNumbers); ++i)
        parameters->setNamedAutoConstant(kDrawNumbers[i], P::ACT_CUSTOM, i);
}

Ogre::MaterialPtr loaded(const Ogre::MaterialPtr& material) {
    material->load();
    if (material->getSupportedTechniques().empty())
        throw std::runtime_error("the graphics system takes no program for a material: " +
                                 material->getUnsupportedTechniquesExplanation());
    return material;
}

Ogre::TextureUnitState& addUnit(Ogre::Pass& pass, const Ogre::TexturePtr& texture, const char* name) {
    const int unit = static_cast<int>(pass.getNumTextureUnitStates());
    Ogre::TextureUnitState* state = pass.createTextureUnitState();
    state->setTexture(texture);
    pass.getFragmentProgramParameters()->setNamedConstant(name, unit);
    return *state;
}

void addPlainUnit(Ogre::Pass& pass, const Ogre::TexturePtr& texture, const char* name) {
    Ogre::TextureUnitState& unit = addUnit(pass, texture, name);
    unit.setTextureAddressingMode(Ogre::TAM_CLAMP);
    unit.setTextureFiltering(Ogre::FO_POINT, Ogre::FO_POINT, Ogre::FO_NONE);
}

}  // namespace

GpuLibrary::~GpuLibrary() {
    auto& manager = Ogre::TextureManager::getSingleton();
    for (const auto& [number, texture] : textures_) manager.remove(texture);
    if (white_) manager.remove(white_);
    if (table_) manager.remove(table_);
}

std::string GpuLibrary::unique(const char* what) {
    return prefix_ + what + std::to_string(++created_);
}

void GpuLibrary::setTexture(std::uint32_t number, const RasterTexture& texture) {
    using namespace Ogre;
    dropTexture(number);
    if (texture.levels.empty()) return;
    const RasterTexture::Level& finest = texture.levels[0];
    const bool wide = !finest.floats.empty();
    const PixelFormat format = wide ? PF_FLOAT32_RGBA : PF_BYTE_RGBA;
    TexturePtr created = TextureManager::getSingleton().createManual(
        unique("texture"), group(), TEX_TYPE_2D, static_cast<uint>(finest.width), static_cast<uint>(finest.height),
        static_cast<int>(texture.levels.size()) - 1, format, TU_STATIC_WRITE_ONLY, nullptr, texture.decoded);
    for (std::size_t i = 0; i < texture.levels.size() && i <= created->getNumMipmaps(); ++i) {
        const RasterTexture::Level& level = texture.levels[i];
        const void* pixels = wide ? static_cast<const void*>(level.floats.data()) : level.bytes.data();
        const PixelBox box(static_cast<uint32>(level.width), static_cast<uint32>(level.height), 1, format,
                           const_cast<void*>(pixels));
        created->getBuffer(0, i)->blitFromMemory(box);
    }
    textures_[number] = created;
}

void GpuLibrary::dropTexture(std::uint32_t number) {
    const auto found = textures_.find(number);
    if (found == textures_.end()) return;
    Ogre::TextureManager::getSingleton().remove(found->second);
    textures_.erase(found);
}

const Ogre::TexturePtr& GpuLibrary::texture(std::uint32_t number) {
    if (const auto found = textures_.find(number); found != textures_.end()) return found->second;
    if (!white_) {
        constexpr std::uint32_t kWhite = 0;
        RasterTexture texture;
        const std::uint32_t pixel = 0xFFFFFFFF;
        texture.levels.push_back({1, 1, {&pixel, 1}, {}});
        setTexture(kWhite, texture);
        white_ = textures_[kWhite];
        textures_.erase(kWhite);
    }
    return white_;
}

bool GpuLibrary::setTable(std::vector<glm::vec4> texels) {
    using namespace Ogre;
    if (texels.size() > std::size_t{kTableWidth} * kTableHeight) return false;
    if (!table_)  // of one size, since materials hold it
        table_ = TextureManager::getSingleton().createManual(unique("table"), group(), TEX_TYPE_2D, kTableWidth,
                                                             kTableHeight, 0, PF_FLOAT32_RGBA, TU_DYNAMIC_WRITE_ONLY);
    const auto rows = static_cast<uint32>(std::max<std::size_t>((texels.size() + kTableWidth - 1) / kTableWidth, 1));
    texels.resize(std::size_t{rows} * kTableWidth, glm::vec4(0));
    table_->getBuffer()->blitFromMemory(PixelBox(kTableWidth, rows, 1, PF_FLOAT32_RGBA, texels.data()),
                                        Box(0, 0, kTableWidth, rows));
    return true;
}

void GpuLibrary::usePrograms(Ogre::Pass& pass, const ProgramKey& key) {
    const std::string name = "rtsg " + key.name();
    pass.setGpuProgram(Ogre::GPT_VERTEX_PROGRAM, program(name + " v", Ogre::GPT_VERTEX_PROGRAM, vertexProgram(key)));
    pass.setGpuProgram(Ogre::GPT_FRAGMENT_PROGRAM,
                       program(name + " f", Ogre::GPT_FRAGMENT_PROGRAM, fragmentProgram(key)));
    bindNumbers(pass.getVertexProgramParameters());
    bindNumbers(pass.getFragmentProgramParameters());
}

void GpuLibrary::setNumbers(Ogre::Pass& pass, const RasterMaterial& m) {
    Ogre::GpuProgramParameters& p = *pass.getFragmentProgramParameters();
    p.setNamedConstant("baseColor", vector(m.base, m.opacity));
    p.setNamedConstant("specularColor", vector(m.specular, m.exponent));
    p.setNamedConstant("emissiveColor", vector(m.emissive, 0));
    p.setNamedConstant("numbers", Ogre::Vector4(m.ambient, m.metallic, m.roughness, m.cutoff));
    p.setNamedConstant("more", Ogre::Vector4(m.normalScale, m.occlusionStrength, static_cast<float>(m.alpha), 0));
    p.setNamedConstant("mirrors", vector(m.reflectivity, 0));
    const auto style = static_cast<float>(m.hatchStyle);
    p.setNamedConstant("hatching", vector(m.hatchColor, m.filled ? style : -style));
    // One by one, because graphics systems count only the used elements of an array, and OGRE takes that for an error.
    for (std::size_t i = 0; i < kRasterUses; ++i) {
        const RasterUse& use = m.uses[i];
        p.setNamedConstant("rowS" + std::to_string(i), vector(use.s, use.encodes ? 1.0f : 0.0f));
        p.setNamedConstant("rowT" + std::to_string(i), vector(use.t, use.mixed ? 0.0f : 1.0f));
    }
}

void GpuLibrary::setUp(Ogre::Pass& pass, const RasterMaterial& material, bool numbers) {
    using namespace Ogre;
    // Which sides are drawn is the thing's matter, not the material's.
    pass.setCullingMode(CULL_NONE);
    pass.setManualCullingMode(MANUAL_CULL_NONE);
    pass.setLightingEnabled(false);
    if (material.clear && !numbers) {
        pass.setSeparateSceneBlending(SBF_ONE, SBF_ONE_MINUS_SOURCE_ALPHA, SBF_ONE, SBF_ONE_MINUS_SOURCE_ALPHA);
        pass.setDepthWriteEnabled(material.cutOut);
    }
    ProgramKey key(material);
    key.numbers = numbers;
    usePrograms(pass, key);
    addPlainUnit(pass, table_, "tables");
    for (std::size_t i = 0; i < kRasterUses; ++i) {
        const RasterUse& use = material.uses[i];
        if (use.texture == 0) continue;
        TextureUnitState& unit = addUnit(pass, texture(use.texture), kUseNames[i]);
        unit.setTextureAddressingMode(wrapOf(use.wrapS), wrapOf(use.wrapT), TAM_WRAP);
        unit.setTextureBorderColour(ColourValue(use.border.r, use.border.g, use.border.b, use.border.a));
        unit.setTextureFiltering(use.smoothFar ? FO_LINEAR : FO_POINT, use.smooth ? FO_LINEAR : FO_POINT,
                                 !use.coarse ? FO_NONE
                                 : use.mixed ? FO_LINEAR
                                             : FO_POINT);
    }
    setNumbers(pass, material);
}

Ogre::MaterialPtr GpuLibrary::makeMaterial(const std::string& name, const RasterMaterial& material) {
    Ogre::MaterialPtr created = Ogre::MaterialManager::getSingleton().create(unique(name.c_str()), group());
    setUp(*created->getTechnique(0)->getPass(0), material, false);
    return loaded(created);
}

void GpuLibrary::addNumbers(const Ogre::MaterialPtr& material, const RasterMaterial& from) {
    Ogre::Technique* technique = material->createTechnique();
    technique->setSchemeName(kNumbers);
    setUp(*technique->createPass(), from, true);
    material->unload();  // compiles it again
    loaded(material);
}

Ogre::MaterialPtr GpuLibrary::makeBackground(const std::string& name, const RasterSky& sky) {
    using namespace Ogre;
    MaterialPtr created = MaterialManager::getSingleton().create(unique(name.c_str()), group());
    Pass& pass = *created->getTechnique(0)->getPass(0);
    pass.setCullingMode(CULL_NONE);
    pass.setLightingEnabled(false);
    pass.setDepthCheckEnabled(false);
    pass.setDepthWriteEnabled(false);
    pass.setSeparateSceneBlending(SBF_ONE, SBF_ONE_MINUS_SOURCE_ALPHA, SBF_ONE, SBF_ONE_MINUS_SOURCE_ALPHA);
    ProgramKey key;
    key.background = true;
    usePrograms(pass, key);
    RasterTexture colors;
    colors.levels.push_back({static_cast<int>(sky.colors.size()), 1, {}, sky.colors});
    constexpr std::uint32_t kColors = 0xFFFFFFFF;
    dropTexture(kColors);
    setTexture(kColors, colors);
    addPlainUnit(pass, texture(kColors), "colors");
    float there[6] = {};
    for (std::size_t i = 0; i < sky.sides.size(); ++i) {
        const std::string side = "side" + std::to_string(i);
        TextureUnitState& unit = addUnit(pass, texture(sky.sides[i]), side.c_str());
        unit.setTextureAddressingMode(TAM_CLAMP);
        unit.setTextureFiltering(FO_LINEAR, FO_LINEAR, FO_NONE);
        there[i] = sky.sides[i] != 0;
    }
    GpuProgramParameters& parameters = *pass.getFragmentProgramParameters();
    parameters.setNamedConstant("sidesFirst", Vector4(there[0], there[1], there[2], there[3]));
    parameters.setNamedConstant("sidesLast", Vector4(there[4], there[5], 0, 0));
    const glm::mat3& m = sky.localFromWorld;
    parameters.setNamedConstant("localFromWorld", Matrix4(m[0].x, m[1].x, m[2].x, 0, m[0].y, m[1].y, m[2].y, 0, m[0].z,
                                                          m[1].z, m[2].z, 0, 0, 0, 0, 1));
    return loaded(created);
}

}  // namespace rtsg
