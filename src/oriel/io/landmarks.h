// Landmarks of a pose graph's file: where they begin, their factors, and what they add to the cost of a start.
#pragma once
#include <vector>

#include "oriel/graph/graph.h"
#include "oriel/io/g2o.h"
#include "oriel/manifold/se2.h"
#include "oriel/manifold/se3.h"
#include "oriel/manifold/vector.h"

namespace oriel {

// Each landmark where the first sighting of it in the file puts it. One that is known by bearings alone: where these
// meet, or 1 m along the first of them where they do not.
std::vector<Point2d> place_landmarks2(const PoseGraphFile& file, const std::vector<Pose2d>& poses);
std::vector<Point3d> place_landmarks3(const PoseGraphFile& file, const std::vector<Pose3d>& poses);

// The file's own values where it has them and they are wanted, else placed from the poses.
std::vector<Point2d> start_landmarks2(const PoseGraphFile& file, bool from_file, const std::vector<Pose2d>& poses);
std::vector<Point3d> start_landmarks3(const PoseGraphFile& file, bool from_file, const std::vector<Pose3d>& poses);

// ½Σρ(‖r‖²) of sightings and bearings there.
double landmark_cost2(const PoseGraphFile& file, const std::vector<Pose2d>& poses,
                      const std::vector<Point2d>& landmarks, const Loss& loss);
double landmark_cost3(const PoseGraphFile& file, const std::vector<Pose3d>& poses,
                      const std::vector<Point3d>& landmarks, const Loss& loss);

// Variables, sensors and factors. Returns the landmarks' ids in the order of the file's.
std::vector<VariableId<Point2d>> add_landmarks2(GraphEdit& edit, const PoseGraphFile& file,
                                                const std::vector<VariableId<Pose2d>>& poses,
                                                const std::vector<Point2d>& start, const Loss& loss);
std::vector<VariableId<Point3d>> add_landmarks3(GraphEdit& edit, const PoseGraphFile& file,
                                                const std::vector<VariableId<Pose3d>>& poses,
                                                const std::vector<Point3d>& start, const Loss& loss);

}  // namespace oriel
