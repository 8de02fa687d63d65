#pragma once

#include "CoreMinimal.h"
#include "BoneIndices.h"

struct FCompactPose;

/** The output of an animation: rotations of bones relative to their parents, and places of some. */
struct WAYFARER_API FWayfarerPose
{
	TArray<int32> MeshBones;  // of the reference skeleton; the hips first
	TArray<FQuat> Rotations;  // of each, relative to its parent
	TArray<int32> Placed;     // indices above of bones whose places are set, too: the hips first
	TArray<FVector> Places;   // of each of these, relative to its parent
	bool bValid = false;

	/** Write onto a pose, without bones that the level of detail lacks. Any thread. */
	void ApplyTo(FCompactPose& Pose) const;
};
