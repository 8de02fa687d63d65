#include "WayfarerCharacterComponent.h"

#include "Animation/AnimInstance.h"
#include "BoneContainer.h"
#include "BonePose.h"
#include "Components/SkeletalMeshComponent.h"
#include "Dom/JsonObject.h"
#include "Dom/JsonValue.h"
#include "Engine/GameInstance.h"
#include "Engine/SkeletalMesh.h"
#include "Engine/World.h"
#include "GameFramework/Actor.h"
#include "ReferenceSkeleton.h"
#include "Rendering/SkeletalMeshLODRenderData.h"
#include "Rendering/SkeletalMeshRenderData.h"
#include "Rendering/SkinWeightVertexBuffer.h"
#include "WayfarerAnimInstance.h"
#include "WayfarerSubsystem.h"
#include "wayfarer/wayfarer.h"

void FWayfarerPose::ApplyTo(FCompactPose& Pose) const
{
	if (!bValid) return;
	const FBoneContainer& Container = Pose.GetBoneContainer();
	for (int32 N = 0; N < MeshBones.Num(); ++N)
	{
		const FCompactPoseBoneIndex Index = Container.MakeCompactPoseIndex(FMeshPoseBoneIndex(MeshBones[N]));
		if (Index.GetInt() == INDEX_NONE) continue;
		Pose[Index].SetRotation(Rotations[N]);
		for (int32 K = 0; K < Placed.Num(); ++K)
			if (Placed[K] == N) Pose[Index].SetTranslation(Places[K]);
	}
}

UWayfarerCharacterComponent::UWayfarerCharacterComponent()
{
	PrimaryComponentTick.bCanEverTick = true;
	PrimaryComponentTick.TickGroup = TG_PrePhysics;
}

void UWayfarerCharacterComponent::BeginPlay()
{
	Super::BeginPlay();
	AActor* Owner = GetOwner();
	Mesh = Owner->FindComponentByClass<USkeletalMeshComponent>();
	UWayfarerSubsystem* Subsystem = GetWorld()->GetGameInstance()->GetSubsystem<UWayfarerSubsystem>();
	if (!Mesh || !Subsystem)
	{
		Why = TEXT("the actor has no skeletal mesh component");
		SetComponentTickEnabled(false);
		return;
	}
	Mesh->AddTickPrerequisiteComponent(this);
	if (!Mesh->GetAnimInstance()) Mesh->SetAnimInstanceClass(UWayfarerAnimInstance::StaticClass());
	Why = TEXT("the agent has not come yet");
	if (!AgentId.IsEmpty()) return;
	bCreated = true;
	const FVector Ground = Owner->GetActorLocation() - FVector(0, 0, OriginHeight);
	if (!FindBones())
	{
		SetComponentTickEnabled(false);
		return;
	}
	TWeakObjectPtr<UWayfarerCharacterComponent> Self = this;
	Subsystem->CreateAgent(Owner->GetName(), Ground, Owner->GetActorRotation().Yaw, bFitBody ? Proportions() : nullptr, [Self, Subsystem](const FString& Id) {
		if (!Self.IsValid()) return Subsystem->DeleteAgent(Id);
		Self->AgentId = Id;
		if (Self->WaitingGoal) Subsystem->SetGoal(Id, Self->WaitingGoal->Key, Self->WaitingGoal->Value);
		Self->WaitingGoal.Reset();
	});
}

void UWayfarerCharacterComponent::EndPlay(const EEndPlayReason::Type Reason)
{
	Forget();
	const UWorld* World = GetWorld();
	UGameInstance* Instance = World ? World->GetGameInstance() : nullptr;
	UWayfarerSubsystem* Subsystem = Instance ? Instance->GetSubsystem<UWayfarerSubsystem>() : nullptr;
	if (bCreated && Subsystem && !AgentId.IsEmpty()) Subsystem->DeleteAgent(AgentId);
	Super::EndPlay(Reason);
}

void UWayfarerCharacterComponent::GoTo(const FVector& Location, double Speed)
{
	UWayfarerSubsystem* Subsystem = GetWorld()->GetGameInstance()->GetSubsystem<UWayfarerSubsystem>();
	if (AgentId.IsEmpty()) WaitingGoal = TPair<FVector, double>(Location, Speed);
	else if (Subsystem) Subsystem->SetGoal(AgentId, Location, Speed);
}

TMap<FName, FName> UWayfarerCharacterComponent::BoneTable() const
{
	TMap<FName, FName> Table;
	if (!Map) return Table;
	const FReferenceSkeleton& Skeleton = Mesh->GetSkeletalMeshAsset()->GetRefSkeleton();
	for (int32 N = 0; N < Bones.Num(); ++N) Table.Add(FName(UTF8_TO_TCHAR(wf_bone_name(Bones[N]))), Skeleton.GetBoneName(Current.MeshBones[N]));
	return Table;
}

void UWayfarerCharacterComponent::TickComponent(float DeltaTime, ELevelTick TickType, FActorComponentTickFunction* ThisTickFunction)
{
	Super::TickComponent(DeltaTime, TickType, ThisTickFunction);
	UWayfarerSubsystem* Subsystem = GetWorld()->GetGameInstance()->GetSubsystem<UWayfarerSubsystem>();
	const uint32 Alias = Subsystem && Subsystem->Player() ? Subsystem->AliasOf(AgentId) : 0;
	if (Alias != ShownAlias || (Alias && Subsystem->Generation() != ShownGeneration))
	{
		Forget();
		ShownAlias = Alias;
		ShownGeneration = Subsystem ? Subsystem->Generation() : 0;
		bFailed = Alias && !Prepare(*Subsystem, Alias);
	}
	if (!Alias || bFailed) return;
	const double Moment = Subsystem->Advance();
	size_t Count = 0;
	const float* Frame = wf_agent_frame(Subsystem->Player(), Alias, &Count);
	if (Frame) Show(Frame, Count, Moment);
}

/** Map; false, with the reason in Why, when the mesh is no humanoid. */
bool UWayfarerCharacterComponent::FindBones()
{
	const USkeletalMesh* Asset = Mesh->GetSkeletalMeshAsset();
	if (!Asset)
	{
		Why = TEXT("the skeletal mesh component has no mesh");
		return false;
	}
	const FReferenceSkeleton& Skeleton = Asset->GetRefSkeleton();
	const TArray<FTransform>& Rest = Skeleton.GetRefBonePose();
	wf_rig* Rig = wf_rig_create();
	const FVector Size = Mesh->GetComponentScale();
	const double Nowhere[3] = {0, 0, 0}, Straight[4] = {0, 0, 0, 1}, Scale[3] = {Size.X, Size.Y, Size.Z};
	wf_rig_add(Rig, "the component", -1, Nowhere, Straight, Scale); // so a bone's node is its index + 1
	for (int32 Bone = 0; Bone < Skeleton.GetNum(); ++Bone)
	{
		const FVector P = Rest[Bone].GetTranslation(), S = Rest[Bone].GetScale3D();
		const FQuat Q = Rest[Bone].GetRotation();
		const double Position[3] = {P.X, P.Y, P.Z}, Rotation[4] = {Q.X, Q.Y, Q.Z, Q.W}, Own[3] = {S.X, S.Y, S.Z};
		wf_rig_add(Rig, TCHAR_TO_UTF8(*Skeleton.GetBoneName(Bone).ToString()), Skeleton.GetParentIndex(Bone) + 1, Position, Rotation, Own);
	}
	for (const TPair<FName, FName>& Each : CorrectedBones)
	{
		const FString Bone = Each.Key.ToString(), Node = Each.Value.ToString();
		wf_rig_correct(Rig, TCHAR_TO_UTF8(*Bone), Each.Value.IsNone() ? nullptr : TCHAR_TO_UTF8(*Node));
	}
	wf_map_destroy(Map);
	Map = wf_map_create(Rig, "unreal");
	wf_rig_destroy(Rig);
	const bool bRight = Map != nullptr;
	if (!bRight) Why = UTF8_TO_TCHAR(wf_error());
	else MeasureSoles();
	return bRight;
}

/** Measure the soles from the mesh's vertices in its reference pose, if the processor may read them (Allow CPU Access). */
void UWayfarerCharacterComponent::MeasureSoles()
{
	const FSkeletalMeshRenderData* Render = Mesh->GetSkeletalMeshAsset()->GetResourceForRendering();
	if (!Render || Render->LODRenderData.Num() == 0) return;
	const FSkeletalMeshLODRenderData& Level = Render->LODRenderData[0];
	const FPositionVertexBuffer& Vertices = Level.StaticVertexBuffers.PositionVertexBuffer;
	const FSkinWeightVertexBuffer* Weights = Level.GetSkinWeightVertexBuffer();
	if (!Vertices.GetVertexData() || !Weights || Weights->GetNumVertices() != Vertices.GetNumVertices()) return;
	const FVector Size = Mesh->GetComponentScale();
	TArray<double> Found;
	TArray<int32> Movers;
	for (const FSkelMeshRenderSection& Section : Level.RenderSections)
	{
		for (uint32 Vertex = Section.BaseVertexIndex; Vertex < Section.BaseVertexIndex + Section.NumVertices; ++Vertex)
		{
			uint32 Most = 0;
			for (uint32 K = 1; K < Weights->GetMaxBoneInfluences(); ++K)
				if (Weights->GetBoneWeight(Vertex, K) > Weights->GetBoneWeight(Vertex, Most)) Most = K;
			const FVector3f At = Vertices.VertexPosition(Vertex);
			Found.Add(At.X * Size.X);
			Found.Add(At.Y * Size.Y);
			Found.Add(At.Z * Size.Z);
			Movers.Add(Section.BoneMap[Weights->GetBoneIndex(Vertex, Most)] + 1); // a bone's node is its index + 1
		}
	}
	wf_map_soles(Map, "unreal", Found.GetData(), Movers.GetData(), Movers.Num());
}

/** The request of POST /v1/bodies:fit. */
TSharedPtr<FJsonObject> UWayfarerCharacterComponent::Proportions() const
{
	double Places[3 * WF_BONES], Floor;
	wf_map_joints(Map, "unreal", Places, &Floor);
	TArray<TSharedPtr<FJsonValue>> Joints;
	for (int32 Bone = 0; Bone < WF_BONES; ++Bone)
	{
		if (wf_map_node(Map, Bone) < 0) continue;
		TSharedPtr<FJsonObject> Joint = MakeShared<FJsonObject>(), Position = MakeShared<FJsonObject>();
		Position->SetNumberField(TEXT("x"), Places[3 * Bone]);
		Position->SetNumberField(TEXT("y"), Places[3 * Bone + 1]);
		Position->SetNumberField(TEXT("z"), Places[3 * Bone + 2]);
		Joint->SetStringField(TEXT("bone"), UTF8_TO_TCHAR(wf_bone_name(Bone)));
		Joint->SetObjectField(TEXT("position"), Position);
		Joints.Add(MakeShared<FJsonValueObject>(Joint));
	}
	TSharedPtr<FJsonObject> Wanted = MakeShared<FJsonObject>();
	Wanted->SetStringField(TEXT("basis"), TEXT("unreal"));
	Wanted->SetArrayField(TEXT("joints"), Joints);
	if (Floor == Floor) Wanted->SetNumberField(TEXT("floor"), Floor);
	return Wanted;
}

bool UWayfarerCharacterComponent::Prepare(const UWayfarerSubsystem& Subsystem, uint32 Alias)
{
	if (!FindBones()) return false;
	size_t Count = 0;
	const float* Offsets = wf_agent_rest_offsets(Subsystem.Player(), Alias, &Count);
	Retarget = wf_retarget_create(Map, Offsets, Count, "unreal", NAN);
	Root = wf_root_create("unreal", 0.01);
	if (!Retarget || !Root)
	{
		Why = UTF8_TO_TCHAR(wf_error());
		return false;
	}
	const FReferenceSkeleton& Skeleton = Mesh->GetSkeletalMeshAsset()->GetRefSkeleton();
	const TArray<FTransform>& Rest = Skeleton.GetRefBonePose();
	for (int32 Bone = 0; Bone < WF_BONES; ++Bone)
	{
		const int32 Node = wf_map_node(Map, Bone);
		if (Node < 0) continue;
		Bones.Add(Bone);
		Current.MeshBones.Add(Node - 1);
	}
	Current.Rotations.SetNum(Bones.Num());
	for (int32 N = 0; N < Bones.Num(); ++N)
	{
		double Place[3];
		if (!wf_retarget_moved(Retarget, Bones[N], Place)) continue;
		FTransform Above = FTransform::Identity;
		bool bHangs = false;
		for (int32 Bone = Skeleton.GetParentIndex(Current.MeshBones[N]); Bone >= 0; Bone = Skeleton.GetParentIndex(Bone))
		{
			Above = Above * Rest[Bone];
			bHangs = bHangs || Current.MeshBones.Contains(Bone);
		}
		Current.Placed.Add(N);
		Parents.Add(Above);
		Hanging.Add(bHangs ? 1 : 0);
	}
	Current.Places.SetNum(Current.Placed.Num());
	Why.Reset();
	return true;
}

void UWayfarerCharacterComponent::Show(const float* Frame, size_t Count, double Moment)
{
	if (wf_retarget_pose(Retarget, Frame, Count, NAN) == WF_ERROR)
	{
		Why = UTF8_TO_TCHAR(wf_error());
		return;
	}
	double Local[4 * WF_BONES], World[4 * WF_BONES], Places[3 * WF_BONES];
	wf_retarget_local(Retarget, Local);
	wf_retarget_world(Retarget, World, Places);
	if (bMoveActor)
	{
		double Point[3], Heading;
		wf_root_update(Root, Moment, Frame, wf_retarget_ground(Retarget), Point, &Heading);
		GetOwner()->SetActorLocationAndRotation(FVector(Point[0], Point[1], Point[2] + OriginHeight), FRotator(0, FMath::RadiansToDegrees(Heading), 0));
	}
	for (int32 N = 0; N < Bones.Num(); ++N)
	{
		const double* Q = Local + 4 * Bones[N];
		Current.Rotations[N] = FQuat(Q[0], Q[1], Q[2], Q[3]);
	}
	// the hips are placed in the world: bring them to the component, which may stand and face anywhere, and to their
	// parent; also other bones that hang from no moving bone
	const FTransform Component = Mesh->GetComponentTransform();
	for (int32 K = 0; K < Current.Placed.Num(); ++K)
	{
		const int32 N = Current.Placed[K], Bone = Bones[N];
		double Own[3];
		wf_retarget_moved(Retarget, Bone, Own);
		Current.Places[K] = FVector(Own[0], Own[1], Own[2]);
		if (Hanging[K]) continue;
		const double *Q = World + 4 * Bone, *P = Places + 3 * Bone;
		const FTransform& Above = Parents[K];
		Current.Rotations[N] = Above.GetRotation().Inverse() * (Component.GetRotation().Inverse() * FQuat(Q[0], Q[1], Q[2], Q[3]));
		Current.Places[K] = Above.InverseTransformPosition(Component.InverseTransformPosition(FVector(P[0], P[1], P[2])));
	}
	Current.bValid = true;
}

void UWayfarerCharacterComponent::Forget()
{
	wf_root_destroy(Root);
	wf_retarget_destroy(Retarget);
	wf_map_destroy(Map);
	Root = nullptr;
	Retarget = nullptr;
	Map = nullptr;
	ShownAlias = 0;
	Bones.Reset();
	Parents.Reset();
	Hanging.Reset();
	Current = FWayfarerPose(); // the mesh stands in its rest pose until an agent comes
	Why = TEXT("the agent has not come yet");
}
