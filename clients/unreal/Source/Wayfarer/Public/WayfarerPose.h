#pragma once

#include "CoreMinimal.h"
#include "BoneIndices.h"

struct FCompactPose;

/** What an animation writes: rotations of bones relative to their parents, and the place of the hips. */
struct WAYFARER_API FWayfarerPose
{
	TArray<int32> MeshBones;  // of the reference skeleton; the hips first
	TArray<FQuat> Rotations;  // of each, relative to its parent
	FVector Hips = FVector::ZeroVector; // relative to their parent
	bool bValid = false;

	/** Onto a pose; bones that the level of detail lacks are left out. Any thread. */
	void ApplyTo(FCompactPose& Pose) const;
};
