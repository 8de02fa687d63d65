#pragma once

#include "CoreMinimal.h"
#include "Animation/AnimInstance.h"
#include "Animation/AnimInstanceProxy.h"
#include "WayfarerPose.h"
#include "WayfarerAnimInstance.generated.h"

/** The pose of the actor's UWayfarerCharacterComponent, for meshes without their own graph. */
UCLASS(Transient, NotBlueprintable)
class WAYFARER_API UWayfarerAnimInstance : public UAnimInstance
{
	GENERATED_BODY()

protected:
	virtual FAnimInstanceProxy* CreateAnimInstanceProxy() override;
};

USTRUCT()
struct WAYFARER_API FWayfarerAnimInstanceProxy : public FAnimInstanceProxy
{
	GENERATED_BODY()

	FWayfarerAnimInstanceProxy() = default;
	explicit FWayfarerAnimInstanceProxy(UAnimInstance* Instance) : FAnimInstanceProxy(Instance) {}

	virtual void PreUpdate(UAnimInstance* Instance, float DeltaSeconds) override;
	virtual bool Evaluate(FPoseContext& Output) override;

private:
	FWayfarerPose Pose; // copied on the game thread, written on any
};
