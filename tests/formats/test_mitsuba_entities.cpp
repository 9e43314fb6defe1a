// libs: ambilux_formats ambilux_accel JPEG::JPEG
// Entities that a file declares itself, and the light of a scene that has none.
#include "tests/support/mitsuba_text.h"
#include "transport/emitter.h"

using namespace ambilux;
using namespace ambilux::test;

namespace {

std::string declared(const std::string& declarations, const std::string& body) {
    return "<?xml version='1.0'?>\n<!DOCTYPE scene [\n" + declarations + "\n]>\n<scene version='0.6.0'>\n" + body +
           "\n</scene>\n";
}

const std::string kLight = "<emitter type='constant'/>";

Scene load_declared(const TempFolder& folder, const std::string& declarations, const std::string& body,
                    LoadOptions options = {}) {
    return load_mitsuba(folder.write("scenes/scene.xml", declared(declarations, body + kSensor + kLight)), options);
}

std::string error_of_declared(const TempFolder& folder, const std::string& declarations, const std::string& body,
                              LoadOptions options = {}) {
    try {
        load_declared(folder, declarations, body, options);
    } catch (const Error& e) {
        CHECK(e.code == ExitCode::bad_input);
        return e.what();
    }
    return "no error";
}

}  // namespace

TEST_CASE("entities: text of the file, in elements and in attributes, and nested ones") {
    const TempFolder folder;
    const Scene s =
        load_declared(folder,
                      "<!-- <!ENTITY size '9'> --><!ELEMENT scene ANY>\n<!ENTITY size \"2\">"
                      "<!ENTITY size '3'>\n<!ENTITY ball '<shape type=\"sphere\">\n<float name=\"radius\" "
                      "value=\"&size;\"/>\n</shape>'>",
                      "&ball;<!-- &unknown; -->\n<shape type='sphere'><float name='radius' value='&size;5'/>"
                      "<string name='id' value='a&lt;b &#65; &'/></shape>",
                      [] {
                          LoadOptions o;
                          o.lenient = true;
                          return o;
                      }());
    REQUIRE(s.shapes.size() == 2);
}

TEST_CASE("entities: files, beside the file that names them, with parameters and includes of the scene") {
    const TempFolder folder;
    folder.write("parts/header.xml",
                 "\xEF\xBB\xBF<?xml version='1.0' encoding='utf-8'?>\n<default name='spp' value='7'/>\n"
                 "<include filename='../parts/$what.xml'/>");
    folder.write("parts/direct.xml",
                 "<scene version='0.6.0'>\n<integrator type='path'/>\n<shape type='sphere'/></scene>");
    std::vector<std::string> files;
    LoadOptions options;
    options.files = &files;
    const Scene s = load_declared(folder, "<!ENTITY header SYSTEM \"../parts/header.xml\">",
                                  "<default name='what' value='direct'/>&header;\n<sensor type='perspective'><sampler "
                                  "type='independent'><integer name='sampleCount' value='$spp'/></sampler></sensor>",
                                  options);
    CHECK(s.integrator.spp == 7);
    CHECK(s.shapes.size() == 1);
    CHECK(files.size() == 3);
}

TEST_CASE("entities: what is wrong is an error with its line") {
    const TempFolder folder;
    CHECK(contains(error_of_declared(folder, "", "\n&nothing;"), "scene.xml:7: entity '&nothing;' is not declared"));
    CHECK(contains(error_of_declared(folder, "<!ENTITY a SYSTEM 'missing.xml'>", "&a;"),
                   "scene.xml:3: file 'missing.xml' does not exist"));
    folder.write("scenes/secret.txt", " password");
    const std::string secret =
        error_of_declared(folder, "<!ENTITY a SYSTEM 'secret.txt'>", "<integer name='n' value='&a;'/>");
    CHECK(contains(secret, "scene.xml:3: file 'secret.txt' of an entity does not begin with an element"));
    CHECK(!contains(secret, "password"));
    CHECK(contains(error_of_declared(folder, "<!ENTITY a '&b;'><!ENTITY b '&a;'>", "&a;"),
                   "scene.xml:6: entity '&a;' holds itself"));
    CHECK(contains(error_of_declared(folder, "<!ENTITY % a 'text'>", ""), "entities with % are not supported"));
    CHECK(contains(error_of_declared(folder, "<!ENTITY a 'text>", ""), "the quotes are not closed"));
    // Lines behind an entity of several lines keep their numbers.
    CHECK(contains(error_of_declared(folder, "<!ENTITY a '<shape type=\"sphere\">\n\n</shape>'>", "&a;\n<nonsense/>"),
                   "scene.xml:9: unknown element <nonsense>"));
    std::string laughs = "<!ENTITY e0 '          '>";
    for (int i = 1; i < 12; ++i) {
        const std::string inner = "&e" + std::to_string(i - 1) + ";";
        laughs += "<!ENTITY e" + std::to_string(i) + " '";
        for (int k = 0; k < 10; ++k) laughs += inner;
        laughs += "'>";
    }
    LoadOptions options;
    options.limits.expansion = 100000;
    CHECK(contains(error_of_declared(folder, laughs, "&e11;", options),
                   "entities expand to more than --limits expansion=100000 characters"));
}

TEST_CASE("a scene of format 0.x without emitters is lit by sun and sky, a newer one by nothing") {
    const std::string ball = "<shape type='sphere'/>";
    const TempFolder folder;
    const Scene old = load_mitsuba(folder.write("scene.xml", wrap(ball + kSensor, "0.6.0"))),
                newer = load_quietly(ball, "2.0.0");
    CHECK(old.warnings.empty());
    CHECK(has_note(old, "the scene has no emitter; as in Mitsuba 0.6 one of type sunsky lights it"));
    CHECK(has_note(newer, "the scene has no emitter: its image is black"));
    CHECK(newer.emitters.empty());
    const Scene same = load_quietly(ball +
                                        "<emitter type='sunsky'><float name='scale' value='2'/><boolean name='extend' "
                                        "value='true'/><float name='sunRadiusScale' value='15'/><transform "
                                        "name='toWorld'><rotate y='1' angle='-120'/></transform></emitter>",
                                    "0.6.0");
    REQUIRE(old.emitters.size() == same.emitters.size());
    REQUIRE(!old.emitters.empty());
    CHECK(old.texels == same.texels);
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) CHECK(old.emitters[0].to_world.m[i][k] == same.emitters[0].to_world.m[i][k]);
    CHECK_FALSE(has_note(same, "no emitter"));
}
