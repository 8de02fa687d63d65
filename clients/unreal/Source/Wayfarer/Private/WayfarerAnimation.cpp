// The two ways into an animation: a node of a graph, and an instance without one.

#include "AnimNode_Wayfarer.h"
#include "BonePose.h"
#include "GameFramework/Actor.h"
#include "WayfarerAnimInstance.h"
#include "WayfarerCharacterComponent.h"

namespace
{
/** The component of the actor that owns the mesh. Game thread. */
void Copy(const UAnimInstance* Instance, FWayfarerPose& Pose)
{
	const AActor* Owner = Instance ? Instance->GetOwningActor() : nullptr;
	const UWayfarerCharacterComponent* Character = Owner ? Owner->FindComponentByClass<UWayfarerCharacterComponent>() : nullptr;
	if (Character) Pose = Character->Pose(); // arrays keep their room
	else Pose.bValid = false;
}
}

void FAnimNode_Wayfarer::Initialize_AnyThread(const FAnimationInitializeContext& Context)
{
	FAnimNode_Base::Initialize_AnyThread(Context);
	Source.Initialize(Context);
}

void FAnimNode_Wayfarer::CacheBones_AnyThread(const FAnimationCacheBonesContext& Context)
{
	Source.CacheBones(Context);
}

void FAnimNode_Wayfarer::Update_AnyThread(const FAnimationUpdateContext& Context)
{
	Source.Update(Context);
}

void FAnimNode_Wayfarer::PreUpdate(const UAnimInstance* Instance)
{
	Copy(Instance, Pose);
}

void FAnimNode_Wayfarer::Evaluate_AnyThread(FPoseContext& Output)
{
	Source.Evaluate(Output);
	Pose.ApplyTo(Output.Pose);
}

FAnimInstanceProxy* UWayfarerAnimInstance::CreateAnimInstanceProxy()
{
	return new FWayfarerAnimInstanceProxy(this);
}

void FWayfarerAnimInstanceProxy::PreUpdate(UAnimInstance* Instance, float DeltaSeconds)
{
	FAnimInstanceProxy::PreUpdate(Instance, DeltaSeconds);
	Copy(Instance, Pose);
}

bool FWayfarerAnimInstanceProxy::Evaluate(FPoseContext& Output)
{
	Output.ResetToRefPose();
	Pose.ApplyTo(Output.Pose);
	return true;
}
