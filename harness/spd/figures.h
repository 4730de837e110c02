// What others counted on the Standard Procedural Databases (Haines 1987) at their default sizes.
#pragma once

#include <cstdint>
#include <limits>
#include <string_view>

namespace raybench {

/// Nobody counted that.
inline constexpr double kUncounted = std::numeric_limits<double>::quiet_NaN();

struct SpdFigure {
  double published;  ///< Havran and Sixta 1999; of octrees Havran 1999. Opaque surfaces were one-sided there
  double check;      ///< an independent check in double by the rules of TraceRules::kSpd
};

/// Rays of the picture of 513 x 513 camera rays.
struct SpdCounts {
  std::string_view scene;
  SpdFigure primitives, camera_rays, camera_hits, shadow_rays, shadow_blocked, secondary_rays, secondary_hits,
      all_rays;
};

/// Uniform grid at a resolution that he printed; the last three are per ray.
struct SpdGrid {
  std::string_view scene;
  uint32_t resolution[3];
  SpdFigure empty_cells, references, steps, empty_steps, tests;
};

/// Octree divided at centres until one primitive is left or the depth is reached; the last two are per ray
/// (of `tests` see kNote of cli/spd.cpp).
struct SpdOctree {
  std::string_view scene;
  uint32_t depth;
  SpdFigure inner_nodes, leaves, empty_leaves, references, tests, leaves_visited;
};

inline constexpr SpdFigure kSpdCameraRays{513 * 513, 513 * 513};

inline constexpr SpdCounts kSpdCounts[] = {{"balls",
                                            {7382, 7382},
                                            kSpdCameraRays,
                                            {263169, 263169},
                                            {959244, 954980},
                                            {285178, 287616},
                                            {179884, 175932},
                                            {134368, 126792},
                                            {1402297, 1394081}},
                                           {"gears",
                                            {9345, 9345},
                                            kSpdCameraRays,
                                            {245332, 245332},
                                            {2088012, 2126702},
                                            {1057557, 840010},
                                            {494338, 506382},
                                            {365338, 384049},
                                            {2845519, 2896253}},
                                           {"mount",
                                            {8196, 8196},
                                            kSpdCameraRays,
                                            {173685, 173686},
                                            {361037, 363349},
                                            {74555, 77116},
                                            {710436, 712356},
                                            {472351, 476908},
                                            {1334642, 1338874}},
                                           {"teapot",
                                            {9264, 9264},
                                            kSpdCameraRays,
                                            {161546, 161546},
                                            {406340, 406401},
                                            {34757, 35156},
                                            {226235, 226182},
                                            {67688, 67616},
                                            {895744, 895752}},
                                           {"tetra",
                                            {4096, 4096},
                                            kSpdCameraRays,
                                            {49950, 49950},
                                            {46262, 46261},
                                            {5538, 5557},
                                            {0, 0},
                                            {0, 0},
                                            {309431, 309430}}};

inline constexpr SpdGrid kSpdGrids[] = {
    {"tetra", {35, 35, 35}, {37311, 37311}, {35936, 35936}, {15.97, 15.94}, {14.36, 14.33}, {10.01, 10.01}},
    {"tetra", {16, 16, 16}, {3104, 3018}, {12556, 13396}, {7.43, 7.41}, {5.83, 5.85}, {20.64, 19.68}},
    {"teapot", {28, 29, 11}, {7226, 7231}, {22982, 22565}, {14.98, 14.89}, {12.25, 12.12}, {33.65, 33.13}},
    {"mount", {20, 20, 20}, {6502, 6520}, {21746, 21341}, {8.85, 8.54}, {4.97, 4.89}, {19.01, 18.08}},
    {"balls", {46, 46, 3}, {4208, 4208}, {10240, 10257}, {5.69, 5.73}, {3.00, 3.01}, {358.66, 348.87}}};

inline constexpr SpdOctree kSpdOctrees[] = {{"balls",
                                             6,
                                             {304, 309},
                                             {2129, 2164},
                                             {1038, 1072},
                                             {15611, 15536},
                                             {209.60, kUncounted},
                                             {19.88, kUncounted}},
                                            {"mount",
                                             5,
                                             {1019, 1015},
                                             {7134, 7106},
                                             {3060, 3073},
                                             {34351, 33486},
                                             {23.72, kUncounted},
                                             {6.08, kUncounted}},
                                            {"teapot",
                                             5,
                                             {1001, 1017},
                                             {7008, 7120},
                                             {3450, 3549},
                                             {34072, 32384},
                                             {78.30, kUncounted},
                                             {9.73, kUncounted}}};

}  // namespace raybench
