// Makes the mesh of a GameObject felt. It may move, turn and scale at any time: the hand feels that, too.
using UnityEngine;

namespace Hapticd
{
    [AddComponentMenu("Haptics/Haptic Object")]
    [RequireComponent(typeof(MeshFilter))]
    public sealed class HapticObject : MonoBehaviour
    {
        [Tooltip("The device that touches it; empty: the only one of the scene")]
        public HapticHand hand;
        [Tooltip("0 to 1: 500 N/m, or what the device can bear")]
        [Range(0, 1)] public float stiffness = 0.8f;
        [Range(0, 1)] public float damping;
        [Range(0, 1)] public float staticFriction = 0.3f;
        [Range(0, 1)] public float dynamicFriction = 0.2f;
        [Tooltip("Force at which the surface gives way; 0: never")]
        [Range(0, 1)] public float popthrough;

        double[] sent;  // the last placement
        Surface sentSurface;

        /// <summary>Its number in the haptic scene.</summary>
        public int Number { get; internal set; }

        void OnEnable()
        {
            if (hand == null) hand = FindObjectOfType<HapticHand>();
            if (hand == null) Debug.LogWarning("hapticd: no HapticHand in the scene for '" + name + "'", this);
            else hand.Add(this);
        }

        void OnDisable()
        {
            if (hand != null) hand.Remove(this);
        }

        /// <summary>Sends the mesh anew, after it was changed.</summary>
        public void MeshChanged()
        {
            if (hand != null && hand.IsConnected) Upload(hand.Client);
        }

        internal void Upload(HapticClient client)
        {
            Mesh mesh = GetComponent<MeshFilter>().sharedMesh;
            if (mesh == null || !mesh.isReadable)
            {
                Debug.LogWarning("hapticd: the mesh of '" + name + "' is " +
                                 (mesh == null ? "missing" : "not readable: enable Read/Write in its import settings"), this);
                return;
            }
            client.Batch(() =>
            {
                client.SetObjectCount(Number + 1);
                client.SetMesh(Number, DeviceFrame.Vertices(mesh.vertices), DeviceFrame.Triangles(mesh.triangles));
                client.SetTouchable(Number, true);
                sent = null;
                Follow(client);
                SetSurface(client, CurrentSurface());
            });
            client.SetObjectName(Number, Shortened(name));
        }

        internal void Follow(HapticClient client)
        {
            double[] now = DeviceFrame.Columns(hand.transform, transform.localToWorldMatrix, hand.scale);
            if (sent == null || !System.Linq.Enumerable.SequenceEqual(now, sent))
            {
                client.SetTransform(Number, now);
                sent = now;
            }
            Surface surface = CurrentSurface();
            if (!surface.Equals(sentSurface)) SetSurface(client, surface);
        }

        void SetSurface(HapticClient client, Surface surface)
        {
            client.SetSurface(Number, surface);
            sentSurface = surface;
        }

        Surface CurrentSurface()
        {
            return new Surface {
                Stiffness = stiffness,
                Damping = damping,
                StaticFriction = staticFriction,
                DynamicFriction = System.Math.Min(dynamicFriction, staticFriction),
                Popthrough = popthrough,
            };
        }

        static string Shortened(string text)
        {
            while (System.Text.Encoding.UTF8.GetByteCount(text) > 64) text = text.Substring(0, text.Length - 1);
            return text;
        }
    }
}
