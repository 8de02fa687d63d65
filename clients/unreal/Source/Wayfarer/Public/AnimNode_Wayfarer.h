#pragma once

#include "CoreMinimal.h"
#include "Animation/AnimNodeBase.h"
#include "WayfarerPose.h"
#include "AnimNode_Wayfarer.generated.h"

class UAnimInstance;

/** The pose of the actor's UWayfarerCharacterComponent, over the incoming pose (fingers, face). */
USTRUCT(BlueprintInternalUseOnly)
struct WAYFARER_API FAnimNode_Wayfarer : public FAnimNode_Base
{
	GENERATED_BODY()

	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = Links)
	FPoseLink Source;

	virtual void Initialize_AnyThread(const FAnimationInitializeContext& Context) override;
	virtual void CacheBones_AnyThread(const FAnimationCacheBonesContext& Context) override;
	virtual void Update_AnyThread(const FAnimationUpdateContext& Context) override;
	virtual void Evaluate_AnyThread(FPoseContext& Output) override;
	virtual bool HasPreUpdate() const override { return true; }
	virtual void PreUpdate(const UAnimInstance* Instance) override;

private:
	FWayfarerPose Pose; // copied on the game thread, written on any
};
