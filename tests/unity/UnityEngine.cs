// As much of UnityEngine as the components of unity/ use, written from its documentation, so that they run without Unity:
// left-handed frames, quaternions that turn v into q * v, matrices with m[row, column]. A test calls what Unity would call.
using System;
using System.Collections.Generic;
using System.Reflection;

namespace UnityEngine
{
    public class AddComponentMenu : Attribute { public AddComponentMenu(string path) {} }
    public class RequireComponent : Attribute { public RequireComponent(Type type) {} }
    public class TooltipAttribute : Attribute { public TooltipAttribute(string text) {} }
    public class RangeAttribute : Attribute { public RangeAttribute(float min, float max) {} }

    public static class Time { public static float unscaledTime; }

    public static class Debug
    {
        public static readonly List<string> Lines = new List<string>();
        public static void Log(object text, Object context) { Lines.Add("log " + text); }
        public static void LogWarning(object text, Object context) { Lines.Add("warning " + text); }
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return new Vector3(0, 0, 0); } }
        public static Vector3 one { get { return new Vector3(1, 1, 1); } }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
        public static Vector3 operator *(float s, Vector3 v) { return new Vector3(s * v.x, s * v.y, s * v.z); }
        public float magnitude { get { return (float)Math.Sqrt(x * x + y * y + z * z); } }
        public override string ToString() { return "(" + x + ", " + y + ", " + z + ")"; }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity { get { return new Quaternion(0, 0, 0, 1); } }
        public static Quaternion AngleAxis(float degrees, Vector3 axis)
        {
            double half = degrees * Math.PI / 360;
            float s = (float)Math.Sin(half) / axis.magnitude;
            return new Quaternion(s * axis.x, s * axis.y, s * axis.z, (float)Math.Cos(half));
        }
        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            return new Quaternion(a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
                                  a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        }
        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            Quaternion turned = q * new Quaternion(v.x, v.y, v.z, 0) * new Quaternion(-q.x, -q.y, -q.z, q.w);
            return new Vector3(turned.x, turned.y, turned.z);
        }
    }

    public struct Matrix4x4
    {
        float[] m;
        public float this[int row, int column] { get { return m[4 * row + column]; } }
        public static Matrix4x4 TRS(Vector3 position, Quaternion rotation, Vector3 scale)
        {
            Vector3 x = scale.x * (rotation * new Vector3(1, 0, 0));
            Vector3 y = scale.y * (rotation * new Vector3(0, 1, 0));
            Vector3 z = scale.z * (rotation * new Vector3(0, 0, 1));
            Vector3 p = position;
            return new Matrix4x4 {
                m = new[] { x.x, y.x, z.x, p.x, x.y, y.y, z.y, p.y, x.z, y.z, z.z, p.z, 0, 0, 0, 1 } };
        }
        public static Matrix4x4 operator *(Matrix4x4 a, Matrix4x4 b)
        {
            float[] product = new float[16];
            for (int i = 0; i < 16; ++i)
                for (int k = 0; k < 4; ++k) product[i] += a.m[i / 4 * 4 + k] * b.m[4 * k + i % 4];
            return new Matrix4x4 { m = product };
        }
        /// <summary>Of a matrix that turns and moves, and no more.</summary>
        public Matrix4x4 inverse
        {
            get
            {
                float[] i = new float[16];
                for (int row = 0; row < 3; ++row)
                {
                    for (int column = 0; column < 3; ++column)
                    {
                        i[4 * row + column] = m[4 * column + row];
                        i[4 * row + 3] -= m[4 * column + row] * m[4 * column + 3];
                    }
                }
                i[15] = 1;
                return new Matrix4x4 { m = i };
            }
        }
    }

    public class Object
    {
        public string name = "";
        protected static readonly List<Component> All = new List<Component>();
        public static T FindObjectOfType<T>() where T : class
        {
            foreach (Component component in All)
            {
                T found = component as T;
                if (found != null) return found;
            }
            return null;
        }
    }

    public class Component : Object
    {
        public GameObject gameObject;
        public Transform transform { get { return gameObject.transform; } }
        public T GetComponent<T>() where T : class { return gameObject.GetComponent<T>(); }
        protected internal static void Register(Component component) { All.Add(component); }
        protected internal static void Forget(Component component) { All.Remove(component); }
    }

    public class Transform : Component
    {
        public Vector3 position = Vector3.zero;
        public Quaternion rotation = Quaternion.identity;
        public Vector3 localScale = Vector3.one;
        public Matrix4x4 localToWorldMatrix { get { return Matrix4x4.TRS(position, rotation, localScale); } }
    }

    public class MonoBehaviour : Component
    {
    }

    public class Mesh : Object
    {
        public Vector3[] vertices = new Vector3[0];
        public int[] triangles = new int[0];
        public bool isReadable = true;
    }

    public class MeshFilter : Component
    {
        public Mesh sharedMesh;
    }

    public class GameObject : Object
    {
        readonly List<Component> components = new List<Component>();
        public readonly Transform transform = new Transform();

        public GameObject(string name)
        {
            this.name = name;
            transform.gameObject = this;
        }
        public T AddComponent<T>() where T : Component, new()
        {
            T component = new T { gameObject = this, name = name };
            components.Add(component);
            Component.Register(component);
            return component;
        }
        public T GetComponent<T>() where T : class
        {
            foreach (Component component in components)
            {
                T found = component as T;
                if (found != null) return found;
            }
            return null;
        }
        /// <summary>What Unity calls: Update, OnEnable, OnDisable.</summary>
        public void Call(string message)
        {
            foreach (Component component in components)
            {
                MethodInfo method = component.GetType().GetMethod(message, BindingFlags.Instance | BindingFlags.NonPublic);
                if (method != null) method.Invoke(component, null);
            }
        }
    }
}
