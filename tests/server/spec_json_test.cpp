#include "server/spec_json.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/base/diagnostic.h"

namespace strata::server {
namespace {

struct Refused {
  const char* json;
  const char* field;
  const char* says;  // a part of the message
};

TEST(SpecText, IsReadAsTheSameMessage) {
  const char* full = R"({"volume":{"mode":"points","points":[[1,2,3],[0.1,-4e-7,5]]},
    "sizing":{"max_size":0.1,"min_size":1e-9,"patches":[{"patches":["a*","b"],"size":0.3}],"curvature_deg":12,"gap_cells":2.5,
      "boxes":[{"min":[0,0,0],"max":[1,1,1],"size":0.2}],"spheres":[{"centre":[0,1,0],"radius":2,"size":0.1}],
      "cylinders":[{"from":[0,0,0],"to":[1,0,0],"radius":0.5,"size":0.1}],"gradation":1.5,"max_cells":9007199254740991,"min_level":1,
      "max_level":7,"curves":[{"between":["a","b"],"size":0.01}],
      "background":{"min":[0,0,0],"max":[1,1,1],"counts":[2,2,2],"sizes":[1,2,3,4,5,6,7,8]}},
    "features":{"ridge_angle_deg":33,"sharp_edges":"fillet"},
    "layers":[{"patches":["w"],"count":5,"first_height":1e-5,"growth":1.2,"last_height":0.1,"total_thickness":0.3,"relative":true,
      "ending":"cross_imprint","neighbours":[{"patches":["x"],"ending":"wedge"}],"side":2,"blending":3,"give_up":["count","growth"]},
      {"patches":["\"quoted\" \u00fc"],"blending":"none"},{"patches":["v"],"blending":"auto"}],
    "seed":42})";
  const v1::MeshSpec spec = parse_spec(full);
  EXPECT_EQ(spec_text(parse_spec(spec_text(spec))), spec_text(spec));
  EXPECT_EQ(parse_spec(spec_text(spec)).SerializeAsString(), spec.SerializeAsString());
  EXPECT_EQ(parse_spec(spec_text({})).SerializeAsString(), "");
}

class BadSpec : public testing::TestWithParam<Refused> {};

TEST_P(BadSpec, IsRefusedNamingTheFieldAndTheReason) {
  try {
    parse_spec(GetParam().json);
    FAIL() << "accepted " << GetParam().json;
  } catch (const MeshError& error) {
    EXPECT_EQ(error.failure(), Failure::InvalidInput);
    EXPECT_EQ(error.diagnostic().reason, Reason::SpecInvalid);
    EXPECT_EQ(error.diagnostic().field, GetParam().field);
    EXPECT_NE(std::string(error.what()).find(GetParam().says), std::string::npos) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadSpec,
    testing::Values(Refused{"", "", "not JSON"}, Refused{"{", "", "not JSON"}, Refused{"{\"seed\":1e999}", "", "not JSON"},
                    Refused{"[]", "", "must be an object"}, Refused{"3", "", "must be an object"},
                    Refused{R"({"layer":[]})", "layer", "did you mean \"layers\""},
                    Refused{R"({"zzzzzzzz":1})", "zzzzzzzz", "known here: volume, sizing"},
                    Refused{R"({"layers":[{"patches":["a"]},{"patches":["b"],"frist_height":1}]})", "layers[1].frist_height",
                            "did you mean \"first_height\""},
                    Refused{R"({"layers":[{}]})", "layers[0].patches", "required"}, Refused{R"({"layers":{}})", "layers", "must be a list"},
                    Refused{R"({"layers":[{"patches":[]}]})", "layers[0].patches", "at least one"},
                    Refused{R"({"layers":[{"patches":"a"}]})", "layers[0].patches", "must be a list"},
                    Refused{R"({"layers":[{"patches":[1]}]})", "layers[0].patches[0]", "must be a string"},
                    Refused{R"({"layers":[{"patches":["a"],"count":2.5}]})", "layers[0].count", "whole number"},
                    Refused{R"({"layers":[{"patches":["a"],"count":1e12}]})", "layers[0].count", "out of range"},
                    Refused{R"({"layers":[{"patches":["a"],"count":"3"}]})", "layers[0].count", "must be a number"},
                    Refused{R"({"layers":[{"patches":["a"],"growth":null}]})", "layers[0].growth", "must be a number"},
                    Refused{R"({"layers":[{"patches":["a"],"relative":1}]})", "layers[0].relative", "true or false"},
                    Refused{R"({"layers":[{"patches":["a"],"ending":"wegde"}]})", "layers[0].ending", "did you mean \"wedge\""},
                    Refused{R"({"layers":[{"patches":["a"],"side":"left"}]})", "layers[0].side", "\"both\""},
                    Refused{R"({"layers":[{"patches":["a"],"side":1.5}]})", "layers[0].side", "whole"},
                    Refused{R"({"layers":[{"patches":["a"],"blending":"some"}]})", "layers[0].blending", "auto, none"},
                    Refused{R"({"layers":[{"patches":["a"],"blending":true}]})", "layers[0].blending", "must be a string"},
                    Refused{R"({"layers":[{"patches":["a"],"give_up":["grow"]}]})", "layers[0].give_up[0]", "did you mean \"growth\""},
                    Refused{R"({"layers":[{"patches":["a"],"neighbours":[{"patches":["b"]}]}]})", "layers[0].neighbours[0].ending",
                            "required"},
                    Refused{R"({"volume":{"mode":"al"}})", "volume.mode", "not one of"},
                    Refused{R"({"volume":{"points":[[0,0]]}})", "volume.points[0]", "[x, y, z]"},
                    Refused{R"({"volume":{"points":[[0,0,"a"]]}})", "volume.points[0][2]", "must be a number"},
                    Refused{R"({"sizing":{"maxsize":1}})", "sizing.maxsize", "did you mean \"max_size\""},
                    Refused{R"({"sizing":{"patches":[{"patches":["*"]}]}})", "sizing.patches[0].size", "required"},
                    Refused{R"({"sizing":{"boxes":[{"min":[0,0,0],"max":[1,1,1]}]}})", "sizing.boxes[0].size", "required"},
                    Refused{R"({"sizing":{"spheres":[{"center":[0,0,0],"radius":1,"size":1}]}})", "sizing.spheres[0].center",
                            "did you mean \"centre\""},
                    Refused{R"({"sizing":{"max_cells":1.5}})", "sizing.max_cells", "whole"},
                    Refused{R"({"features":{"ridge_angle":40}})", "features.ridge_angle", "did you mean \"ridge_angle_deg\""},
                    Refused{R"({"features":{"sharp_edges":"keep"}})", "features.sharp_edges", "exact, fillet, auto"},
                    Refused{R"({"seed":-1})", "seed", "negative"}));

TEST(Spec, EveryKeyArrivesInTheMessage) {
  const v1::MeshSpec spec = parse_spec(R"({
    "volume": {"mode": "points", "points": [[1, 2, 3]]},
    "sizing": {"max_size": 0.5, "min_size": 0.1, "patches": [{"patches": ["w*"], "size": 0.2}], "curvature_deg": 15,
               "gap_cells": 3, "boxes": [{"min": [0,0,0], "max": [1,1,1], "size": 0.3}],
               "spheres": [{"centre": [0,0,0], "radius": 2, "size": 0.4}],
               "cylinders": [{"from": [0,0,0], "to": [0,0,1], "radius": 3, "size": 0.6}],
               "curves": [{"between": ["wing", "body*"], "size": 0.05}],
               "background": {"min": [0,0,0], "max": [1,2,3], "counts": [2,2,2], "sizes": [1,2,3,4,5,6,7,8]},
               "min_level": 3, "max_level": 9, "gradation": 1.5, "max_cells": 1000},
    "features": {"ridge_angle_deg": 30, "sharp_edges": "fillet"},
    "layers": [{"patches": ["wing*"], "count": 6, "first_height": 0.01, "growth": 1.2, "last_height": 0.02,
                "total_thickness": 0.1, "relative": true, "ending": "cross_imprint",
                "neighbours": [{"patches": ["tail"], "ending": "regular"}], "side": 2, "blending": 3,
                "give_up": ["count", "growth", "first_height"]},
               {"patches": ["b"], "side": "both", "blending": "none"}],
    "seed": 7})");
  EXPECT_EQ(spec.volume().mode(), v1::VolumeSpec::MODE_POINTS);
  EXPECT_EQ(spec.volume().points(0).z(), 3);
  EXPECT_EQ(spec.sizing().max_size(), 0.5);
  EXPECT_EQ(spec.sizing().min_size(), 0.1);
  EXPECT_EQ(spec.sizing().patches(0).patches(0), "w*");
  EXPECT_EQ(spec.sizing().patches(0).size(), 0.2);
  EXPECT_EQ(spec.sizing().curvature_deg(), 15);
  EXPECT_EQ(spec.sizing().gap_cells(), 3);
  EXPECT_EQ(spec.sizing().boxes(0).max().x(), 1);
  EXPECT_EQ(spec.sizing().boxes(0).size(), 0.3);
  EXPECT_EQ(spec.sizing().spheres(0).radius(), 2);
  EXPECT_EQ(spec.sizing().cylinders(0).to().z(), 1);
  EXPECT_EQ(spec.sizing().cylinders(0).radius(), 3);
  EXPECT_EQ(spec.sizing().curves(0).between(1), "body*");
  EXPECT_EQ(spec.sizing().curves(0).size(), 0.05);
  EXPECT_EQ(spec.sizing().background().max().z(), 3);
  EXPECT_EQ(spec.sizing().background().counts(2), 2);
  EXPECT_EQ(spec.sizing().background().sizes(7), 8);
  EXPECT_EQ(spec.sizing().min_level(), 3);
  EXPECT_EQ(spec.sizing().max_level(), 9);
  EXPECT_EQ(spec.sizing().gradation(), 1.5);
  EXPECT_EQ(spec.sizing().max_cells(), 1000);
  EXPECT_EQ(spec.features().ridge_angle_deg(), 30);
  EXPECT_EQ(spec.features().sharp_edges(), v1::FeatureSpec::SHARP_EDGES_FILLET);
  ASSERT_EQ(spec.layers_size(), 2);
  const v1::LayerSpec& layer = spec.layers(0);
  EXPECT_EQ(layer.count(), 6);
  EXPECT_EQ(layer.first_height(), 0.01);
  EXPECT_EQ(layer.growth(), 1.2);
  EXPECT_EQ(layer.last_height(), 0.02);
  EXPECT_EQ(layer.total_thickness(), 0.1);
  EXPECT_TRUE(layer.relative());
  EXPECT_EQ(layer.ending(), v1::ENDING_CROSS_IMPRINT);
  EXPECT_EQ(layer.neighbours(0).ending(), v1::ENDING_REGULAR);
  EXPECT_EQ(layer.side(), 2);
  EXPECT_EQ(layer.blending(), v1::LayerSpec::BLENDING_COUNT);
  EXPECT_EQ(layer.blending_count(), 3);
  ASSERT_EQ(layer.give_up_size(), 3);
  EXPECT_EQ(layer.give_up(0), v1::LayerSpec::GIVE_UP_COUNT);
  EXPECT_FALSE(spec.layers(1).has_side());
  EXPECT_EQ(spec.layers(1).blending(), v1::LayerSpec::BLENDING_NONE);
  EXPECT_EQ(spec.seed(), 7u);
}

TEST(Spec, DeepNestingIsRefusedWithoutOverflowingTheStack) {
  const std::string deep(200'000, '[');
  EXPECT_THROW(parse_spec(deep), MeshError);
}

TEST(DidYouMean, FindsTypingErrorsButNotOtherWords) {
  const std::vector<std::string_view> known = {"count", "growth", "first_height"};
  EXPECT_EQ(did_you_mean("grwoth", known), "growth");
  EXPECT_EQ(did_you_mean("counts", known), "count");
  EXPECT_EQ(did_you_mean("banana", known), "");
}

}  // namespace
}  // namespace strata::server
